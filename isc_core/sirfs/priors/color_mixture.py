"""The Gaussian scale mixture of a colour difference.

Equation: p(x) = sum_k w_k N(x; 0, v_k S), x in R^3, det S = 1. With fixed log-spaced variances v_k,
both the weights and the shared covariance S have closed-form steps of expectation maximisation: S ~
sum_i (sum_k r_ik / v_k) x_i x_i^T with responsibilities r. The samples enter as cells of
(direction, log length), each with its count and the sum of x x^T: m = x^T S^-1 x / 2 of a cell is
exactly the mean of its samples for every S, and the error is of second order in the cell's size.

Citation: A. P. Dempster, N. M. Laird, D. B. Rubin 1977, doi:10.1111/j.2517-6161.1977.tb01600.x; the
model: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .scale_mixture import (
    exp_or_zero,
    refine_weights,
    summed_exponentials,
    summed_exponentials_of_nodes,
)
from .tabulated_potential import TabulatedPotential

TABLE_NODES = 100_000
VARIANCES = 2.0 ** np.linspace(-20, 5, 40)
_DIRECTIONS = 24
_DECADES = (-6, 2)
_PER_DECADE = 40
_PER_DECADE_OF_M = 300


@dataclass(frozen=True, eq=False)
class ColorCells:
    """Cells of colour differences.

    Attributes
    ----------
    counts : (n,) ndarray
        Number of samples in each cell.
    moments : (n, 3, 3) ndarray
        Sum of x x^T over the samples in each cell.
    """

    counts: np.ndarray
    moments: np.ndarray

    @staticmethod
    def of(x: np.ndarray) -> "ColorCells":
        """Return the occupied cells of samples.

        Parameters
        ----------
        x : (n, 3) ndarray
            Finite.

        Returns
        -------
        ColorCells
        """
        x = np.asarray(x, float)
        used, cell = np.unique(_cell_index(x), return_inverse=True)
        counts = np.bincount(cell, minlength=len(used)).astype(float)
        moments = np.empty((len(used), 3, 3))
        for a in range(3):
            for b in range(a, 3):
                moments[:, a, b] = moments[:, b, a] = np.bincount(
                    cell, x[:, a] * x[:, b], len(used)
                )
        return ColorCells(counts, moments)

    @staticmethod
    def merged(parts: Iterable["ColorCells"]) -> "ColorCells":
        """Return the cells of all parts, without merging equal cells.

        Parameters
        ----------
        parts : iterable of ColorCells
            At least one.

        Returns
        -------
        ColorCells
        """
        all_parts = list(parts)
        return ColorCells(
            np.concatenate([p.counts for p in all_parts]),
            np.concatenate([p.moments for p in all_parts]),
        )


def _cell_index(x: np.ndarray) -> np.ndarray:
    """Cell of each sample: a face of the cube (of three, since x and -x are equivalent), two steps
    on it, and a step of log length.
    """
    rows = np.arange(len(x))
    face = np.abs(x).argmax(axis=1)
    largest = x[rows, face]
    scale = np.divide(1.0, largest, out=np.zeros_like(largest), where=largest != 0)
    index = face
    for turn in (1, 2):
        ratio = x[rows, (face + turn) % 3] * scale
        index = index * _DIRECTIONS + np.minimum(
            (ratio + 1) * (_DIRECTIONS / 2), _DIRECTIONS - 1
        ).astype(np.int64)
    with np.errstate(divide="ignore"):
        length = (np.log10(np.abs(largest)) - _DECADES[0]) * _PER_DECADE
    lengths = (_DECADES[1] - _DECADES[0]) * _PER_DECADE
    return index * lengths + np.clip(length, 0, lengths - 1).astype(np.int64)


@dataclass(frozen=True, eq=False)
class ColorScaleMixture:
    """A fitted mixture.

    Attributes
    ----------
    variances, weights : (K,) ndarray
        v_k and w_k.
    covariance : (3, 3) ndarray
        S, with determinant 1.
    reach : float
        Largest m it was fitted to.
    """

    variances: np.ndarray
    weights: np.ndarray
    covariance: np.ndarray
    reach: float

    def whiten(self) -> np.ndarray:
        """Return the symmetric square root of S^-1, (3, 3): m = 0.5 |whiten x|^2."""
        values, vectors = np.linalg.eigh(self.covariance)
        return (vectors / np.sqrt(values)) @ vectors.T

    def log_density(self, m: np.ndarray) -> np.ndarray:
        """Return log p as a function of m.

        The density never underflows at a reachable m: the largest v is 32.

        Parameters
        ----------
        m : ndarray
            Not negative.

        Returns
        -------
        ndarray
            Of the shape of `m`.
        """
        return np.log(summed_exponentials(np.asarray(m, float), self.variances, self._factors))

    def table(self) -> TabulatedPotential:
        """Return the cost -log(p(m) / p(0)) on 100000 nodes from 0 to `reach`."""
        step = self.reach / (TABLE_NODES - 1)
        log_density = np.log(
            summed_exponentials_of_nodes(step, TABLE_NODES, self.variances, self._factors)
        )
        return TabulatedPotential(0.0, step, log_density[0] - log_density)

    @property
    def _factors(self) -> np.ndarray:
        """The density of each component at m = 0, weighted."""
        return self.weights * _peaks(self.variances)


def fit_color_mixture(
    cells: ColorCells, iterations: int = 200, inner: int = 5
) -> ColorScaleMixture:
    """Fit the mixture of highest likelihood.

    Parameters
    ----------
    cells : ColorCells
        Their samples must span all three dimensions.
    iterations : int
        Steps on the weights.
    inner : int
        Every `inner`-th step is also one on the covariance.

    Returns
    -------
    ColorScaleMixture
    """
    moments = cells.moments.reshape(-1, 9)
    covariance = _unit_determinant((moments.sum(axis=0) / cells.counts.sum()).reshape(3, 3))
    weights = np.full(len(VARIANCES), 1 / len(VARIANCES))
    for _ in range(-(-iterations // inner)):
        index, counts, m = _distance_histogram(cells, covariance)
        density = _densities(m, VARIANCES)
        weights = refine_weights(density, counts, weights, inner)
        responsibility = density * weights
        precision = (responsibility @ (1 / VARIANCES)) / responsibility.sum(axis=1)
        covariance = _unit_determinant((precision[index] @ moments).reshape(3, 3))
    reach = float(_half_distance(cells, covariance).max())
    return ColorScaleMixture(VARIANCES.copy(), weights, covariance, reach)


def _distance_histogram(
    cells: ColorCells, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Merge cells of similar m: the bin of each cell; the count and the mean m of each bin."""
    m = _half_distance(cells, covariance)
    with np.errstate(divide="ignore"):
        fine = np.maximum(_PER_DECADE_OF_M * (np.log10(m) + 12), 0).astype(np.int64)
    _, index = np.unique(fine, return_inverse=True)
    counts = np.bincount(index, cells.counts)
    return index, counts, np.bincount(index, cells.counts * m) / counts


def _half_distance(cells: ColorCells, covariance: np.ndarray) -> np.ndarray:
    """Mean of m = 0.5 x^T S^-1 x over each cell."""
    return 0.5 * (cells.moments.reshape(-1, 9) @ np.linalg.inv(covariance).ravel()) / cells.counts


def _unit_determinant(matrix: np.ndarray) -> np.ndarray:
    return matrix / np.cbrt(np.linalg.det(matrix))


def _densities(m: np.ndarray, variances: np.ndarray) -> np.ndarray:
    """N(x; 0, v_k S) as a function of m, of shape (..., K)."""
    return exp_or_zero(-m[..., None] / variances) * _peaks(variances)


def _peaks(variances: np.ndarray) -> np.ndarray:
    """N(0; 0, v_k S)."""
    return np.asarray((2 * np.pi * variances) ** -1.5)
