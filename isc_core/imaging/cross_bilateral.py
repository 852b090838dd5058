"""The joint bilateral filter: averages over near pixels of similar values in a guide.

Problem: a Gaussian average mixes the two sides of an edge, so that its difference from the image
oscillates there.

Equation: along the rows, then along the columns, with the guide g and the mask M,

    (B f)(x) = sum over y of w(x, y) f(y) / sum over y of w(x, y),
    w(x, y) = M(y) exp(-|x - y|^2 / (2 sigma^2) - |g(x) - g(y)|^2 / (2 tau^2)).

Citation: C. Tomasi, R. Manduchi, "Bilateral filtering for gray and color images", ICCV 1998,
doi:10.1109/ICCV.1998.710815; with a guide: G. Petschnigg et al., "Digital photography with flash
and no-flash image pairs", SIGGRAPH 2004, doi:10.1145/1015706.1015777; along rows and columns:
T. Q. Pham, L. J. van Vliet, "Separable bilateral filtering for fast video preprocessing", ICME
2005, doi:10.1109/ICME.2005.1521458.

Limits: rows are filtered first, so a rotated image gives slightly different averages at corners of
the guide.
"""

from dataclasses import dataclass

import numpy as np

from .channels import total

_REACH = 2.5  # standard deviations
_TINY = 1e-6


@dataclass(frozen=True, eq=False)
class _Pass:
    """Averaging along one axis."""

    axis: int
    weights: np.ndarray  # (2 reach + 1, H, W), of sum 1 over the offsets

    def __call__(self, values: np.ndarray) -> np.ndarray:
        shifted = _shifted(values, self.axis, len(self.weights) // 2)
        total = np.zeros_like(values)
        for weight, value in zip(self.weights, shifted, strict=True):
            total += weight * value
        return total


@dataclass(frozen=True)
class CrossBilateral:
    """A joint bilateral filter of one guide.

    Attributes
    ----------
    passes : tuple of _Pass
        Along the rows and along the columns.
    """

    passes: tuple[_Pass, ...]

    @classmethod
    def of(
        cls, guide: np.ndarray, mask: np.ndarray, sigma: float, tolerance: float
    ) -> "CrossBilateral":
        """Compute the weights.

        Parameters
        ----------
        guide : (H, W, C) float32 ndarray
        mask : (H, W) bool ndarray
        sigma : float
            Standard deviation in pixels, > 0.
        tolerance : float
            Standard deviation in units of the guide, tau, > 0.

        Returns
        -------
        CrossBilateral
        """
        return cls(
            tuple(_Pass(axis, _weights(guide, mask, axis, sigma, tolerance)) for axis in (1, 0))
        )

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Average a map.

        Parameters
        ----------
        values : (H, W) float32 ndarray

        Returns
        -------
        (H, W) float32 ndarray
            0 far outside the mask.
        """
        for one in self.passes:
            values = one(values)
        return values


def _weights(
    guide: np.ndarray, mask: np.ndarray, axis: int, sigma: float, tolerance: float
) -> np.ndarray:
    """The weights (2 reach + 1, H, W) of the pixels along an axis, of sum 1."""
    reach = int(np.ceil(_REACH * sigma))
    offsets = np.arange(-reach, reach + 1, dtype=np.float32)
    inside = _shifted(mask.astype(np.float32), axis, reach)
    weights = np.empty((len(offsets), *mask.shape), np.float32)
    for k, other in enumerate(_shifted(guide, axis, reach)):
        unlike = total(np.square(other - guide)) / np.float32(2 * tolerance**2)
        weights[k] = np.exp(-unlike - np.float32(offsets[k] ** 2 / (2 * sigma**2))) * inside[k]
    weights /= np.maximum(weights.sum(axis=0), np.float32(_TINY))
    return weights


def _shifted(values: np.ndarray, axis: int, reach: int) -> list[np.ndarray]:
    """Views of a map moved by each offset along an axis, with 0 beyond its border."""
    widths = [(0, 0)] * values.ndim
    widths[axis] = (reach, reach)
    padded, size = np.pad(values, widths).swapaxes(0, axis), values.shape[axis]
    return [padded[k : k + size].swapaxes(0, axis) for k in range(2 * reach + 1)]
