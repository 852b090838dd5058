"""Resampling of a plane, along one axis and then along the other."""

import math
from collections.abc import Iterator

import numpy as np

from ..numerics.ellpack import Ellpack

_VALUES = 1 << 18  # that a block reads, approximately


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
    result = np.empty((len(down.columns), len(across.columns)), down.weights.dtype)
    for rows, block in banded_products(down, plane):
        result[rows] = (across @ block.T).T
    return result


def banded_products(matrix: Ellpack, values: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Apply a banded matrix to the first axis of some values, a block of its rows at a time.

    Values of another type or layout are converted by blocks, too.

    Parameters
    ----------
    matrix : Ellpack
        (n, m), whose neighbouring rows have nearly the same columns.
    values : (m, ...) ndarray

    Yields
    ------
    rows : slice
        Of the matrix.
    products : (rows, ...) ndarray
    """
    count = len(matrix.columns)
    size = max(math.prod(values.shape[1:]) * max(len(values) // max(count, 1), 1), 1)
    step = max(_VALUES // size, 1)
    for first in range(0, count, step):
        rows = slice(first, min(first + step, count))
        part, columns = matrix.band(rows)
        yield rows, part @ values[columns]
