"""The cost of an absolute (whitened, log) reflectance as a table, stored compactly.

Equation: the full table of n nodes per axis is an upsampling by two of a coarse one: insert zeros,
then filter with (1, 4, 6, 4, 1) / 8 along each axis, zero padded. Only the coarse one is stored.

Citation: P. J. Burt, E. H. Adelson 1983, doi:10.1109/TCOM.1983.1095851 (upsampling); J. T. Barron,
J. Malik 2015, doi:10.1109/TPAMI.2014.2377712 (the model).
"""

import itertools
from dataclasses import dataclass

import numpy as np

from ...numerics.ellpack import Ellpack
from .priors import AbsoluteTable

LOW, HIGH = -7.0, 4.0


@dataclass(frozen=True, eq=False)
class CoarseTable:
    """A table as the upsampling of `base + coarse`, minus its minimum.

    A short float type is then most precise where the cost is low, that is, at likely reflectances.

    Attributes
    ----------
    coarse : (ceil(n / 2), ...) ndarray
        One or three axes of equal length; minimum 0.
    base : float
        What was subtracted from the coarse values.
    nodes : int
        Nodes n of the full table on each axis.
    """

    coarse: np.ndarray
    base: float
    nodes: int

    @staticmethod
    def of(values: np.ndarray, nodes: int, dtype: type = np.float16) -> "CoarseTable":
        """Store coarse values compactly.

        Parameters
        ----------
        values : (ceil(nodes / 2), ...) ndarray
        nodes : int
            Nodes of the full table on each axis.
        dtype : type
            Type to store.

        Returns
        -------
        CoarseTable
        """
        base = float(values.min())
        return CoarseTable((values - base).astype(dtype), base, nodes)

    def table(self) -> AbsoluteTable:
        """Return the full table, float64, minimum 0, over [-7, 4] on each axis."""
        values = synthesise(synthesis_matrix(self.nodes), self.coarse.astype(float) + self.base)
        return AbsoluteTable(LOW, HIGH, values - values.min())


def synthesis_matrix(nodes: int, dtype: type = np.float64) -> Ellpack:
    """Return the upsampling of one axis.

    Parameters
    ----------
    nodes : int
        Number of fine values.
    dtype : type

    Returns
    -------
    Ellpack
        (nodes, ceil(nodes / 2))
    """
    coarse = -(-nodes // 2)
    taps = {-2: 0.125, -1: 0.5, 0: 0.75, 1: 0.5, 2: 0.125}
    column, offset = np.meshgrid(np.arange(coarse), list(taps), indexing="ij")
    row, weight = 2 * column + offset, np.broadcast_to(list(taps.values()), column.shape)
    kept = (row >= 0) & (row < nodes)
    return Ellpack.of(row[kept], column[kept], weight[kept].astype(dtype), (nodes, coarse))


def synthesise(matrix: Ellpack, values: np.ndarray) -> np.ndarray:
    """Apply a matrix along every axis.

    Parameters
    ----------
    matrix : Ellpack
        (n, m)
    values : (m, ..., m) ndarray

    Returns
    -------
    (n, ..., n) ndarray
    """
    for _ in range(values.ndim):
        # Each pass processes the first axis and moves it to the end, so that after all passes the
        # axes are in order again.
        product = matrix @ values.reshape(values.shape[0], -1)
        values = np.ascontiguousarray(np.moveaxis(product.reshape(-1, *values.shape[1:]), 0, -1))
    return values


def splat(points: np.ndarray, nodes: int, weights: np.ndarray) -> np.ndarray:
    """Return the histogram of points over [-7, 4]^d with multilinear weights.

    Points outside are moved to the border.

    Parameters
    ----------
    points : (n, d) ndarray
    nodes : int
        On each axis.
    weights : (n,) ndarray
        Total weight of each point.

    Returns
    -------
    (nodes, ...) ndarray
        With d axes.
    """
    dimensions = points.shape[1]
    position = np.clip((points - LOW) * ((nodes - 1) / (HIGH - LOW)), 0, nodes - 1)
    cell = np.minimum(position.astype(np.int64), nodes - 2)
    fraction = position - cell
    total = np.zeros(nodes**dimensions)
    for corner in itertools.product((0, 1), repeat=dimensions):
        offset = np.array(corner)
        share = np.where(offset == 1, fraction, 1 - fraction).prod(axis=1)
        index = np.ravel_multi_index(tuple((cell + offset).T), (nodes,) * dimensions)
        total += np.bincount(index, share * weights, len(total))
    return total.reshape((nodes,) * dimensions)


def log_likelihood(table: np.ndarray, histogram: np.ndarray) -> float:
    """Return the mean log probability of a histogram under a table.

    The distribution is exp(-table) / sum exp(-table) over the nodes. Evaluated on held-out objects,
    this criterion selects the smoothness of the table.

    Parameters
    ----------
    table : ndarray
    histogram : ndarray
        Of the same shape, sum 1.

    Returns
    -------
    float
    """
    lowest = table.min()
    log_partition = np.log(np.exp(lowest - table).sum()) - lowest
    return -float((histogram * table).sum() + log_partition)
