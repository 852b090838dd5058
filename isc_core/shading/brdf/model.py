"""What a reflectance model is, whichever it is, and how its parameters are checked."""

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
        """f_r (...), or (..., 3) for a coloured model, in 1/sr, >= 0; 0 below the horizon."""
        ...


class Lobe(Model, Protocol):
    """A model without colour, whose derivatives are known."""

    def gradient(self, normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> object:
        """A dataclass with the derivative (...) of f_r by each parameter, under the parameter's
        name.
        """
        ...


def check_range(name: str, value: Parameter | Sequence[float], low: float, high: float) -> None:
    """Raises `InputError` unless every number of `value` is finite and within [low, high]."""
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
    """base^exponent, 0 where the base is not above 0, whatever the exponent."""
    above = base > 0
    return np.where(above, np.where(above, base, 1) ** exponent, 0)


def log_above_zero(base: np.ndarray) -> np.ndarray:
    """log(base), and 0 where the base is not above 0: there the power that it is multiplied with is
    0.
    """
    return np.log(np.where(base > 0, base, 1))
