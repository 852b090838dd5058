# mypy: disable-error-code="no-untyped-def"
"""Matrices of which each row has few entries, in the format ELLPACK.

Equation: (M x)[i] = sum_k w[i, k] x[c[i, k]], with the entries of a row in a fixed order.

Citation: N. Bell and M. Garland 2009, doi:10.1145/1654059.1654078.

Limits: the memory is that of the row with the most entries, times the number of rows.
"""

import math
from dataclasses import dataclass

import numpy as np

from .jit import jit


@dataclass(frozen=True, eq=False)
class Ellpack:
    """A matrix (n, m) with at most K entries in each row.

    Attributes
    ----------
    columns : (n, K) int64 ndarray
        Column of each entry.
    weights : (n, K) float32 or float64 ndarray
        The entries; 0 where a row has fewer.
    width : int
        m.
    """

    columns: np.ndarray
    weights: np.ndarray
    width: int

    @staticmethod
    def of(
        rows: np.ndarray, columns: np.ndarray, weights: np.ndarray, shape: tuple[int, int]
    ) -> "Ellpack":
        """Build a matrix from its entries.

        Parameters
        ----------
        rows, columns : (e,) int ndarray
        weights : (e,) float32 or float64 ndarray
            Entries at the same place are added.
        shape : tuple of int
            (n, m).

        Returns
        -------
        Ellpack
            With the entries of a row in the order of their columns.
        """
        order = np.lexsort((columns, rows))
        rows, columns, weights = rows[order], columns[order], weights[order]
        new = np.ones(len(rows), bool)
        new[1:] = (rows[1:] != rows[:-1]) | (columns[1:] != columns[:-1])
        first = np.flatnonzero(new)
        rows, columns, weights = rows[first], columns[first], np.add.reduceat(weights, first)
        sizes = np.bincount(rows, minlength=shape[0])
        place = np.arange(len(rows)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        matrix = _zeros(shape, int(sizes.max(initial=0)), weights.dtype)
        matrix.columns[rows, place], matrix.weights[rows, place] = columns, weights
        return matrix

    @property
    def transposed(self) -> "Ellpack":
        """The transposed matrix, with the entries of a row in the order of their columns."""
        sizes = np.bincount(self.columns[self.weights != 0], minlength=self.width)
        most = int(sizes.max(initial=0))
        matrix = _zeros((self.width, len(self.columns)), most, self.weights.dtype)
        sizes[:] = 0
        _transpose(self.columns, self.weights, sizes, matrix.columns, matrix.weights)
        return matrix

    @property
    def diagonal(self) -> np.ndarray:
        """The diagonal, (n,)."""
        own = self.columns == np.arange(len(self.columns))[:, None]
        return np.asarray(np.where(own, self.weights, 0).sum(axis=1))

    @property
    def dense(self) -> np.ndarray:
        """The matrix (n, m) as an array."""
        array = np.zeros((len(self.columns), self.width), self.weights.dtype)
        rows = np.broadcast_to(np.arange(len(array))[:, None], self.columns.shape)
        kept = self.weights != 0
        np.add.at(array, (rows[kept], self.columns[kept]), self.weights[kept])
        return array

    def part(self, rows: slice, columns: slice) -> "Ellpack":
        """Return a part of the matrix.

        Parameters
        ----------
        rows, columns : slice
            Each with a start and an end.

        Returns
        -------
        Ellpack
        """
        width = columns.stop - columns.start
        shifted, weights = self.columns[rows] - columns.start, self.weights[rows].copy()
        outside = (shifted < 0) | (shifted >= width)
        shifted[outside] = weights[outside] = 0
        return Ellpack(shifted, weights, width)

    def band(self, rows: slice) -> tuple["Ellpack", slice]:
        """Return some rows with the columns that they use, for matrices with a narrow band.

        Parameters
        ----------
        rows : slice

        Returns
        -------
        part : Ellpack
        columns : slice
            From the first to the last one used; one column if none is.
        """
        used = self.columns[rows][self.weights[rows] != 0]
        columns = slice(int(used.min()), int(used.max()) + 1) if used.size else slice(0, 1)
        return self.part(rows, columns), columns

    def __matmul__(self, values: np.ndarray) -> np.ndarray:
        """Apply the matrix to the first axis of (m, ...) values, in the type of the weights."""
        count = math.prod(values.shape[1:])
        flat = np.ascontiguousarray(values, self.weights.dtype).reshape(self.width, count)
        result = np.empty((len(self.columns), count), self.weights.dtype)
        if count == 1:
            _apply(flat[:, 0], self.columns, self.weights, result[:, 0])
        else:
            _combine(flat, self.columns, self.weights, result)
        return result.reshape(len(result), *values.shape[1:])

    def times(self, other: "Ellpack") -> "Ellpack":
        """Multiply two matrices.

        Parameters
        ----------
        other : Ellpack
            (m, l).

        Returns
        -------
        Ellpack
            (n, l), float64.
        """
        left, right = (self.columns, self.weights), (other.columns, other.weights)
        place = np.full(other.width, -1)
        most = _longest_row(*left, *right, place)
        matrix = _zeros((len(self.columns), other.width), most, np.dtype(float))
        place[:] = -1
        _multiply(*left, *right, place, matrix.columns, matrix.weights)
        return matrix


def _zeros(shape: tuple[int, int], most: int, dtype: np.dtype) -> Ellpack:
    size = shape[0], max(most, 1)
    return Ellpack(np.zeros(size, np.int64), np.zeros(size, dtype), shape[1])


@jit(types="r[1] i8[2] r[2] r[1]")
def _apply(values, columns, weights, result):
    """Write the product with a vector into `result`."""
    for i in range(columns.shape[0]):
        row, factors = columns[i], weights[i]
        total = factors[0] * values[row[0]]
        for k in range(1, len(row)):
            total += factors[k] * values[row[k]]
        result[i] = total


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


@jit(types="i8[2] r[2] i8[1] i8[2] r[2]")
def _transpose(columns, weights, sizes, new_columns, new_weights):
    """Write the transposed matrix; `sizes` counts the entries of its rows, from 0."""
    for i in range(columns.shape[0]):
        for k in range(columns.shape[1]):
            if weights[i, k] != 0:
                row = columns[i, k]
                new_columns[row, sizes[row]] = i
                new_weights[row, sizes[row]] = weights[i, k]
                sizes[row] += 1


@jit(types="i8[2] f8[2] i8[2] f8[2] i8[1] -> i8")
def _longest_row(columns, weights, other_columns, other_weights, place):
    """Return the number of entries of the product's longest row; `place` is -1 for each column, and
    then the last row that has it.
    """
    most = 0
    for i in range(columns.shape[0]):
        size = 0
        for k in range(columns.shape[1]):
            if weights[i, k] == 0:
                continue
            row, factors = other_columns[columns[i, k]], other_weights[columns[i, k]]
            for m in range(len(row)):
                if factors[m] != 0 and place[row[m]] != i:
                    place[row[m]] = i
                    size += 1
        most = max(most, size)
    return most


@jit(types="i8[2] f8[2] i8[2] f8[2] i8[1] i8[2] f8[2]")
def _multiply(columns, weights, other_columns, other_weights, place, new_columns, new_weights):
    """Write the product; `place` is -1 for each column that is not in the present row."""
    for i in range(columns.shape[0]):
        size = 0
        entries, sums = new_columns[i], new_weights[i]
        for k in range(columns.shape[1]):
            weight = weights[i, k]
            if weight == 0:
                continue
            row, factors = other_columns[columns[i, k]], other_weights[columns[i, k]]
            for m in range(len(row)):
                if factors[m] == 0:
                    continue
                at = place[row[m]]
                if at < 0:
                    at = place[row[m]] = size
                    entries[at] = row[m]
                    size += 1
                sums[at] += weight * factors[m]
        for k in range(size):
            place[entries[k]] = -1
