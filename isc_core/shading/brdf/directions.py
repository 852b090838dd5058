"""Cosines and half vectors of a normal, a view and a light, for all reflectance models."""

from dataclasses import dataclass

import numpy as np

from ...errors import InputError

# A cosine below this is below the horizon: it keeps finite what a model divides by a cosine.
HORIZON = 1e-9
_UNIT_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class Cosines:
    """Cosines between directions, each (...).

    Attributes
    ----------
    view, light, half : ndarray
        Of the angle between the normal and the view, the light, the half vector; clamped to [0, 1].
    deviation : ndarray
        Of the angle between view and half vector, in [0, 1].
    between : ndarray
        Of the angle between view and light, in [-1, 1].
    lit : bool ndarray
        Whether view and light are both above the horizon. Where it is False, `view` and `light`
        are 1, so that they can be divisors.
    """

    view: np.ndarray
    light: np.ndarray
    half: np.ndarray
    deviation: np.ndarray
    between: np.ndarray
    lit: np.ndarray


def cosines(normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> Cosines:
    """Compute the cosines between unit vectors that broadcast with each other.

    Parameters
    ----------
    normal, view, light : (..., 3) ndarray

    Returns
    -------
    Cosines

    Raises
    ------
    InputError
        For other shapes, values that are not finite, and lengths that are not 1 to 1e-3.
    """
    normal, view, light = unit(normal, "normal"), unit(view, "view"), unit(light, "light")
    try:
        np.broadcast_shapes(normal.shape, view.shape, light.shape)
    except ValueError:
        raise InputError(
            f"normal {normal.shape}, view {view.shape} and light {light.shape}"
            " do not broadcast with each other"
        ) from None
    half = half_vector(view, light)
    cos_view, cos_light, cos_half = _dot(normal, view), _dot(normal, light), _dot(normal, half)
    lit = (cos_view > HORIZON) & (cos_light > HORIZON)
    return Cosines(
        view=np.where(lit, np.minimum(cos_view, 1), 1),
        light=np.where(lit, np.minimum(cos_light, 1), 1),
        half=np.clip(cos_half, 0, 1),
        deviation=np.clip(_dot(view, half), 0, 1),
        between=np.clip(_dot(view, light), -1, 1),
        lit=lit,
    )


def half_vector(view: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Return the unit vectors midway between two directions.

    Parameters
    ----------
    view, light : (..., 3) ndarray
        Of unit length.

    Returns
    -------
    (..., 3) ndarray
        Zero where the directions are opposite.
    """
    total = np.asarray(view, float) + np.asarray(light, float)
    length = np.sqrt((total * total).sum(axis=-1, keepdims=True))
    return np.where(length > HORIZON, total / np.maximum(length, HORIZON), 0)


def unit(vectors: np.ndarray, name: str) -> np.ndarray:
    """Normalise vectors that are nearly of unit length.

    Parameters
    ----------
    vectors : (..., 3) ndarray
    name : str
        For the error message.

    Returns
    -------
    (..., 3) ndarray

    Raises
    ------
    InputError
        If they are not finite or their lengths not 1 to 1e-3.
    """
    vectors = np.asarray(vectors, float)
    if vectors.ndim == 0 or vectors.shape[-1] != 3:
        raise InputError(f"{name} has shape {vectors.shape}: give unit vectors of shape (..., 3)")
    length = np.sqrt(_dot(vectors, vectors))
    if not (np.abs(length - 1) <= _UNIT_TOLERANCE).all():
        raise InputError(
            f"{name} holds vectors that are not of length 1: divide each by its length"
        )
    return vectors / length[..., None]


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)
