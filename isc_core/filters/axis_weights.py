# mypy: disable-error-code="no-untyped-def"
"""Weighted sums of rows: the matrices of resampling, of which each row has few entries.

Equation: y[i] = sum_k w[i, k] x[c[i, k]] for every column of x, with the entries of a row in the
order of their columns. A whole image is resampled along one axis and then along the other.
"""

from dataclasses import dataclass

import numpy as np

from ..numerics.jit import jit


@dataclass(frozen=True)
class AxisWeights:
    """A matrix (n, m) with at most K entries in each row.

    Attributes
    ----------
    columns : (n, K) int64 ndarray
        Column of each entry.
    weights : (n, K) float32 or float64 ndarray
        The entries; 0 where a row has fewer.
    """

    columns: np.ndarray
    weights: np.ndarray

    @staticmethod
    def of(rows: np.ndarray, columns: np.ndarray, weights: np.ndarray, count: int) -> "AxisWeights":
        """Build the matrix from its entries.

        Parameters
        ----------
        rows, columns : (e,) int ndarray
        weights : (e,) float32 or float64 ndarray
            Entries at the same place are added.
        count : int
            Number of rows.

        Returns
        -------
        AxisWeights
        """
        order = np.lexsort((columns, rows))
        rows, columns, weights = rows[order], columns[order], weights[order]
        new = np.ones(len(rows), bool)
        new[1:] = (rows[1:] != rows[:-1]) | (columns[1:] != columns[:-1])
        first = np.flatnonzero(new)
        weights = np.add.reduceat(weights, first)
        rows, columns = rows[first], columns[first]
        sizes = np.bincount(rows, minlength=count)
        place = np.arange(len(rows)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        shape = count, int(sizes.max())
        matrix = AxisWeights(np.zeros(shape, np.int64), np.zeros(shape, weights.dtype))
        matrix.columns[rows, place], matrix.weights[rows, place] = columns, weights
        return matrix

    def transposed(self, count: int) -> "AxisWeights":
        """Return the transposed matrix.

        Parameters
        ----------
        count : int
            Number m of columns of this one.

        Returns
        -------
        AxisWeights
            (m, n).
        """
        kept = self.weights != 0
        rows = np.broadcast_to(np.arange(len(self.columns))[:, None], self.columns.shape)
        return AxisWeights.of(self.columns[kept], rows[kept], self.weights[kept], count)

    def part(self, rows: slice, columns: slice) -> "AxisWeights":
        """Return a part of the matrix.

        Parameters
        ----------
        rows, columns : slice
            Each with a start and an end.

        Returns
        -------
        AxisWeights
        """
        shifted = self.columns[rows] - columns.start
        inside = (shifted >= 0) & (shifted < columns.stop - columns.start)
        return AxisWeights(
            np.where(inside, shifted, 0), np.where(inside, self.weights[rows], np.float32(0))
        )

    def __matmul__(self, values: np.ndarray) -> np.ndarray:
        """Apply the matrix to the first axis of (m, ...) values, in the type of the weights."""
        flat = np.ascontiguousarray(values, self.weights.dtype).reshape(len(values), -1)
        result = np.empty((len(self.columns), flat.shape[1]), self.weights.dtype)
        _combine(flat, self.columns, self.weights, result)
        return result.reshape(-1, *values.shape[1:])


def linear_interpolation(places: np.ndarray, size: int, dtype: type = np.float64) -> AxisWeights:
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
    AxisWeights
        (n, size).
    """
    inside = np.clip(places, 0, size - 1)
    low = np.minimum(inside.astype(np.int64), max(size - 2, 0))
    part = inside - low
    columns = np.stack([low, np.minimum(low + 1, size - 1)], axis=1)
    return AxisWeights(columns, np.stack([1 - part, part], axis=1).astype(dtype))


def resampled_plane(plane: np.ndarray, down: AxisWeights, across: AxisWeights) -> np.ndarray:
    """Apply one matrix to the columns of a plane, and another to its rows.

    Parameters
    ----------
    plane : (H, W) ndarray
    down, across : AxisWeights
        (h, H) and (w, W), of one type.

    Returns
    -------
    (h, w) ndarray
    """
    return np.asarray((across @ (down @ plane).T).T)


@jit(types="r[2] i8[2] r[2] r[2]")
def _combine(values, columns, weights, result):
    """Write the weighted sums of rows into `result`."""
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            result[i, j] = 0
        for k in range(columns.shape[1]):
            row, weight = columns[i, k], weights[i, k]
            if weight != 0:
                for j in range(result.shape[1]):
                    result[i, j] += weight * values[row, j]
