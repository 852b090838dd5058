"""Resampling of a plane, along one axis and then along the other."""

import numpy as np

from ..numerics.ellpack import Ellpack


def linear_interpolation(places: np.ndarray, size: int, dtype: type = np.float64) -> Ellpack:
    """Return the matrix that interpolates linearly between neighbouring values.

    Parameters
    ----------
    places : (n,) ndarray
        Where to interpolate; beyond the first and last value, these continue.
    size : int
        Number of values.
    dtype : type
        Of the weights.

    Returns
    -------
    Ellpack
        (n, size).
    """
    inside = np.clip(places, 0, size - 1)
    low = np.minimum(inside.astype(np.int64), max(size - 2, 0))
    part = inside - low
    columns = np.stack([low, np.minimum(low + 1, size - 1)], axis=1)
    return Ellpack(columns, np.stack([1 - part, part], axis=1).astype(dtype), size)


def resampled_plane(plane: np.ndarray, down: Ellpack, across: Ellpack) -> np.ndarray:
    """Apply one matrix to the columns of a plane, and another to its rows.

    Parameters
    ----------
    plane : (H, W) ndarray
    down, across : Ellpack
        (h, H) and (w, W), of one type.

    Returns
    -------
    (h, w) ndarray
        Of the type of the matrices.
    """
    return np.asarray((across @ (down @ plane).T).T)
