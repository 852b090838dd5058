"""Zero-mean Gaussian scale mixtures of one number, for differences of curvature and of grey log
reflectance.

p(x) = sum_k w_k N(x; 0, s_k^2) with fixed, log-spaced s_k; the weights are fitted by expectation
maximisation (A. P. Dempster, N. M. Laird, D. B. Rubin 1977,
doi:10.1111/j.2517-6161.1977.tb01600.x). The use for shape and reflectance: J. T. Barron, J. Malik
(2015), doi:10.1109/TPAMI.2014.2377712.

The samples (millions of pairs) enter as a histogram of |x| on a logarithmic grid with each bin's
own mean of x^2, which is all that a Gaussian sees of them; bins are 1/300 of a decade wide, so that
what is lost is of second order in 0.8 %.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from .tabulated_potential import TabulatedPotential

TABLE_NODES = 20_000
LOG_DENSITY_FLOOR = -300.0
_DECADES = (-9, 3)
_PER_DECADE = 300


@dataclass(frozen=True)
class Magnitudes:
    """A histogram of |x|:

    `counts` and `squares` (sum of x^2) of each bin, the sum of |x| and the largest |x|.
    """

    counts: np.ndarray
    squares: np.ndarray
    absolute_sum: float
    largest: float

    @staticmethod
    def of(x: np.ndarray) -> "Magnitudes":
        """The histogram of samples `x` (any shape, finite).

        Magnitudes below 1e-9 or above 1e3 share the first or last bin.
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
        """The histogram of all samples of `parts` together (at least one part)."""
        all_parts = list(parts)
        counts = np.sum([p.counts for p in all_parts], axis=0)
        squares = np.sum([p.squares for p in all_parts], axis=0)
        return Magnitudes(
            counts,
            squares,
            sum(p.absolute_sum for p in all_parts),
            max(p.largest for p in all_parts),
        )


@dataclass(frozen=True)
class ScaleMixture:
    """`deviations` s_k and `weights` w_k (sum 1), both (K,), and `reach`, the largest |x| the
    mixture was fitted to.
    """

    deviations: np.ndarray
    weights: np.ndarray
    reach: float

    def log_density(self, x: np.ndarray) -> np.ndarray:
        """log p(x), not below -300; same shape as `x`."""
        density = _densities(np.asarray(x, float) ** 2, self.deviations) @ self.weights
        return np.log(np.maximum(density, np.exp(LOG_DENSITY_FLOOR)))

    def table(self) -> TabulatedPotential:
        """The cost -log(p(x) / p(0)) on 20000 nodes from -reach to reach."""
        nodes = np.linspace(-self.reach, self.reach, TABLE_NODES)
        peak = self.log_density(np.zeros(1))[0]
        return TabulatedPotential(
            -self.reach, 2 * self.reach / (TABLE_NODES - 1), peak - self.log_density(nodes)
        )


def fit_scale_mixture(
    samples: Magnitudes, components: int = 40, iterations: int = 200
) -> ScaleMixture:
    """The mixture of highest likelihood that `iterations` steps reach from equal weights.

    The deviations run from mean|x| / 1000 to 3 max|x|. Raises `InputError` where all samples are 0.
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
    """Weights (K,) after some steps of expectation maximisation;

    `density` (n, K) of the components, `counts` (n,).
    """
    total = counts.sum()
    for _ in range(iterations):
        weights = weights * (density.T @ (counts / (density @ weights))) / total
    return weights / weights.sum()


def _densities(squares: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """N(x; 0, s_k^2) for `squares` x^2, of shape (..., K)."""
    return np.exp(-squares[..., None] / (2 * deviations**2)) / (np.sqrt(2 * np.pi) * deviations)
