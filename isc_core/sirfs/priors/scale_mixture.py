"""Zero-mean Gaussian scale mixtures of a scalar, for differences of curvature and of grey log
reflectance.

Equation: p(x) = sum_k w_k N(x; 0, s_k^2) with fixed, log-spaced s_k; the weights are fitted by
expectation maximisation. The samples (millions of pairs) enter as a histogram of |x| on a
logarithmic grid with each bin's own mean of x^2, which is all that a Gaussian depends on; bins are
1/300 of a decade wide, so the error is of second order in 0.8 %.

Citation: A. P. Dempster, N. M. Laird, D. B. Rubin 1977, doi:10.1111/j.2517-6161.1977.tb01600.x; the
use for shape and reflectance: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from .tabulated_potential import TabulatedPotential

TABLE_NODES = 20_000
LOG_DENSITY_FLOOR = -300.0
_UNDERFLOW = -746.0  # exp of this or less is 0 in float64
_DECADES = (-9, 3)
_PER_DECADE = 300


@dataclass(frozen=True, eq=False)
class Magnitudes:
    """A histogram of |x|.

    Attributes
    ----------
    counts, squares : (bins,) ndarray
        Samples of each bin, and their sum of x^2.
    absolute_sum : float
        Sum of |x|.
    largest : float
        Largest |x|.
    """

    counts: np.ndarray
    squares: np.ndarray
    absolute_sum: float
    largest: float

    @staticmethod
    def of(x: np.ndarray) -> "Magnitudes":
        """Return the histogram of the magnitudes of samples.

        Magnitudes below 1e-9 or above 1e3 share the first or last bin.

        Parameters
        ----------
        x : ndarray
            Finite, of any shape.

        Returns
        -------
        Magnitudes
        """
        size = np.abs(np.asarray(x, float)).ravel()
        bins = (_DECADES[1] - _DECADES[0]) * _PER_DECADE
        with np.errstate(divide="ignore"):
            position = (np.log10(size) - _DECADES[0]) * _PER_DECADE
        index = np.clip(position, 0, bins - 1).astype(np.int64)
        counts = np.bincount(index, minlength=bins).astype(float)
        return Magnitudes(
            counts,
            np.bincount(index, size**2, bins),
            float(size.sum()),
            float(size.max(initial=0.0)),
        )

    @staticmethod
    def merged(parts: Iterable["Magnitudes"]) -> "Magnitudes":
        """Return the histogram of all samples together.

        Parameters
        ----------
        parts : iterable of Magnitudes
            At least one.

        Returns
        -------
        Magnitudes
        """
        all_parts = list(parts)
        counts = np.sum([p.counts for p in all_parts], axis=0)
        squares = np.sum([p.squares for p in all_parts], axis=0)
        return Magnitudes(
            counts,
            squares,
            sum(p.absolute_sum for p in all_parts),
            max(p.largest for p in all_parts),
        )


@dataclass(frozen=True, eq=False)
class ScaleMixture:
    """A fitted mixture.

    Attributes
    ----------
    deviations, weights : (K,) ndarray
        s_k, and w_k with sum 1.
    reach : float
        Largest |x| it was fitted to.
    """

    deviations: np.ndarray
    weights: np.ndarray
    reach: float

    def log_density(self, x: np.ndarray) -> np.ndarray:
        """Return log p(x).

        Parameters
        ----------
        x : ndarray

        Returns
        -------
        float64 ndarray
            At least -300, of the shape of `x`.
        """
        factors = self.weights / (np.sqrt(2 * np.pi) * self.deviations)
        density = summed_exponentials(np.asarray(x, float) ** 2, 2 * self.deviations**2, factors)
        return np.log(np.maximum(density, np.exp(LOG_DENSITY_FLOOR)))

    def table(self) -> TabulatedPotential:
        """Return the cost -log(p(x) / p(0)) on 20000 nodes from -`reach` to `reach`."""
        nodes = np.linspace(-self.reach, self.reach, TABLE_NODES)
        peak = self.log_density(np.zeros(1))[0]
        return TabulatedPotential(
            -self.reach, 2 * self.reach / (TABLE_NODES - 1), peak - self.log_density(nodes)
        )


def fit_scale_mixture(
    samples: Magnitudes, components: int = 40, iterations: int = 200
) -> ScaleMixture:
    """Fit the mixture of highest likelihood, starting at equal weights.

    The deviations run from mean|x| / 1000 to 3 max|x|.

    Parameters
    ----------
    samples : Magnitudes
    components : int
        Number of deviations.
    iterations : int
        Steps of expectation maximisation.

    Returns
    -------
    ScaleMixture

    Raises
    ------
    InputError
        If all samples are 0.
    """
    if samples.largest == 0:
        raise InputError(
            "the training objects are flat or of one grey: give objects with some shape and texture"
        )
    used = samples.counts > 0
    counts = samples.counts[used]
    mean = samples.absolute_sum / counts.sum()
    deviations = np.geomspace(mean / 1000, 3 * samples.largest, components)
    density = _densities(samples.squares[used] / counts, deviations)
    return ScaleMixture(
        deviations,
        refine_weights(density, counts, np.full(components, 1 / components), iterations),
        samples.largest,
    )


def refine_weights(
    density: np.ndarray, counts: np.ndarray, weights: np.ndarray, iterations: int
) -> np.ndarray:
    """Take some steps of expectation maximisation.

    Parameters
    ----------
    density : (n, K) ndarray
        Of the components, at n samples.
    counts : (n,) ndarray
    weights : (K,) ndarray
        Start.
    iterations : int

    Returns
    -------
    (K,) ndarray
        Sum 1.
    """
    total = counts.sum()
    for _ in range(iterations):
        weights = weights * (density.T @ (counts / (density @ weights))) / total
    return weights / weights.sum()


def _densities(squares: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """N(x; 0, s_k^2) for `squares` x^2, of shape (..., K)."""
    exponent = -squares[..., None] / (2 * deviations**2)
    return exp_or_zero(exponent) / (np.sqrt(2 * np.pi) * deviations)


def summed_exponentials(x: np.ndarray, scales: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return sum_k factors[k] exp(-x / scales[k]), without calling `exp` where it underflows.

    Parameters
    ----------
    x : ndarray
        Not negative.
    scales, factors : (K,) ndarray

    Returns
    -------
    float64 ndarray
        Of the shape of `x`.
    """
    order = np.argsort(x, axis=None, kind="stable")  # takes no time if they are sorted
    ascending = x.ravel()[order]
    sums = np.zeros(x.size)
    for scale, factor in zip(scales, factors, strict=True):
        near = ascending[: np.searchsorted(ascending, -_UNDERFLOW * scale)]
        sums[: len(near)] += factor * np.exp(near / -scale)
    found = np.empty(x.shape)
    found.ravel()[order] = sums
    return found


def summed_exponentials_of_nodes(
    step: float, count: int, scales: np.ndarray, factors: np.ndarray
) -> np.ndarray:
    """Return `summed_exponentials` of the nodes 0, step, 2 step, ...

    The exponential of a sum is a product: with nodes i m + j, of i, j < m, each component takes 2 m
    exponentials instead of m^2.

    Parameters
    ----------
    step : float
    count : int
        Number of nodes, at least 1.
    scales, factors : (K,) ndarray

    Returns
    -------
    (count,) float64 ndarray
    """
    side = math.isqrt(count - 1) + 1
    fine = np.arange(side) * step
    coarse = fine * side
    sums = np.zeros((side, side))
    for scale, factor in zip(scales, factors, strict=True):
        near = coarse[: np.searchsorted(coarse, -_UNDERFLOW * scale)]
        sums[: len(near)] += np.multiply.outer(
            factor * np.exp(near / -scale), np.exp(fine / -scale)
        )
    return sums.ravel()[:count]


def exp_or_zero(exponent: np.ndarray) -> np.ndarray:
    """Return exp(exponent), without calling `exp` where it underflows, as for most narrow
    components.

    The C library's `exp` takes many times as long where it underflows.

    Parameters
    ----------
    exponent : float64 ndarray
        At most 0.

    Returns
    -------
    ndarray
        Of the same shape.
    """
    found = np.zeros(exponent.shape)
    return np.exp(exponent, out=found, where=exponent > _UNDERFLOW)
