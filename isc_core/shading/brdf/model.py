"""The interface of reflectance models, and the checks of their parameters."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ...errors import InputError

Parameter = float | np.ndarray


class Model(Protocol):
    """A reflectance model.

    Normal, view and light are unit vectors (..., 3) away from the surface, broadcast with each
    other.
    """

    def value(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        """Return f_r.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Of unit length.

        Returns
        -------
        (...) or (..., 3) ndarray
            In 1/sr, not negative, 0 below the horizon; three channels for a coloured model.
        """
        ...


class Lobe(Model, Protocol):
    """A model without colour, whose derivatives are known."""

    def gradient(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> object:
        """Return the derivatives of f_r by the parameters.

        Parameters
        ----------
        normal, view, light : (..., 3) ndarray
            Unit vectors in one frame: surface normal, and directions to the camera and to the
            light.

        Returns
        -------
        object
            A dataclass with the derivative (...) by each parameter, under its name.
        """
        ...


def check_range(name: str, value: Parameter | Sequence[float], low: float, high: float) -> None:
    """Check the range of a parameter.

    Parameters
    ----------
    name : str
        For the error message.
    value : float, ndarray or sequence of float
    low, high : float
        Smallest and largest value.

    Raises
    ------
    InputError
        Unless every number is finite and within [low, high].
    """
    numbers = np.asarray(value)
    if (
        numbers.dtype.kind not in "fiu"
        or not numbers.size
        or not (np.isfinite(numbers) & (numbers >= low) & (numbers <= high)).all()
    ):
        raise InputError(
            f"{name} has to be "
            + (
                f"within [{low:g}, {high:g}]"
                if np.isfinite(high)
                else f"finite and at least {low:g}"
            )
        )


def power(base: np.ndarray, exponent: Parameter) -> np.ndarray:
    """Return base^exponent, 0 where the base is not above 0, whatever the exponent.

    Parameters
    ----------
    base : ndarray
    exponent : float or ndarray
        Broadcast against `base`.

    Returns
    -------
    ndarray
        Of the broadcast shape.
    """
    above = base > 0
    return np.where(above, np.where(above, base, 1) ** exponent, 0)


def log_above_zero(base: np.ndarray) -> np.ndarray:
    """Return the natural logarithm, 0 where the argument is not above 0.

    There the power that the logarithm multiplies is 0.

    Parameters
    ----------
    base : ndarray

    Returns
    -------
    ndarray
        Of the shape of `base`.
    """
    return np.log(np.where(base > 0, base, 1))
