"""How alike two images are in structure, where a photo's highlights are, and whether a confidence
knows where the errors are.

Structural similarity: Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli (2004),
doi:10.1109/TIP.2003.819861: (2 m_t m_u + C1)(2 v_tu + C2) / ((m_t^2 + m_u^2 + C1)(v_t + v_u + C2)),
means m and biased (co)variances v under a Gaussian window of sigma 1.5 and 11 taps, C1 = (.01
peak)^2, C2 = (.03 peak)^2, border values continued, averaged. `ssim` takes each channel by itself;
`ssim_volume` also runs the window across the channels, as MATLAB's `ssim` does with an H x W x 3
array, from which published figures of highlight removal come. The two differ by up to .04: never
mix them.

Sparsification: pixels are dropped from the least confident on; a confidence that means something
takes the error with it.

Limits: none of this is a perceptual distance; all of it needs the truth.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

_SIGMA, _RADIUS = 1.5, 5
_TAPS = np.exp(-0.5 * (np.arange(-_RADIUS, _RADIUS + 1) / _SIGMA) ** 2)
_TAPS /= _TAPS.sum()

# A pixel belongs to a highlight from this share of the photo's strongest specular light on; the
# strongest is a quantile.
_HIGHLIGHT_SHARE, _STRONGEST = 0.1, 99.9


def ssim(
    truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None = None, *, peak: float = 1.0
) -> float:
    """Structural similarity of images (H, W, C), each channel by itself, then their mean; 1 for
    equal images.

    `mask` (H, W) bool: the map is averaged inside it, and windows see the images as they are given,
    so set what is outside to the same value in both. `peak`: the range of the values. Raises
    `ValueError` for shapes that differ and for an empty mask.
    """
    return _similarity(truth, estimate, mask, peak, axes=(0, 1))


def ssim_volume(
    truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None = None, *, peak: float = 1.0
) -> float:
    """As `ssim`, with the window across the channels as well: the images are taken as volumes (H,
    W, C).
    """
    return _similarity(truth, estimate, mask, peak, axes=(0, 1, 2))


def highlight_region(specular: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Where the highlights are, (H, W) bool: the channels' mean of the true `specular` (H, W, 3) is
    above a tenth of its 99.9th percentile inside `mask` (H, W) bool. Empty where nothing is
    specular. Raises `ValueError` for an empty mask.
    """
    if not mask.any():
        raise ValueError("the mask is empty")
    light = np.where(mask, specular.mean(axis=2), 0)
    return mask & (
        light > _HIGHLIGHT_SHARE * max(float(np.percentile(light[mask], _STRONGEST)), 0.0)
    )


@dataclass(frozen=True)
class Sparsification:
    """How the error leaves with the least confident pixels.

    `dropped` (n,): shares of the pixels, from 0 to 1. `left` (n,): the share of the total error
    that the kept pixels hold, from 1 to 0.
    """

    dropped: np.ndarray
    left: np.ndarray

    @property
    def area(self) -> float:
        """Under the curve: .5 for a confidence that knows nothing, less the better; the least
        possible depends on the errors.
        """
        return float(((self.left[1:] + self.left[:-1]) / 2 * np.diff(self.dropped)).sum())

    def removed(self, share: float) -> float:
        """The share of the error, in [0, 1], that leaves with the given share of the pixels."""
        return 1 - float(np.interp(share, self.dropped, self.left))


def sparsification(error: np.ndarray, confidence: np.ndarray) -> Sparsification:
    """The curve of `error` (n,) >= 0 and `confidence` (n,), any scale, larger is surer.

    Pixels of equal confidence leave in no order: each carries their mean error. Without any error
    the curve is that of a confidence that knows nothing. Raises `ValueError` for arrays that are
    empty or differ in length.
    """
    _same_length(error, confidence)
    _, group, count = np.unique(confidence, return_inverse=True, return_counts=True)
    sums = np.bincount(group, weights=np.asarray(error, float))
    total = sums.sum()
    dropped = np.concatenate([[0.0], np.cumsum(count) / len(group)])
    gone = np.minimum(np.cumsum(sums) / total, 1) if total > 0 else dropped[1:]
    return Sparsification(dropped, np.concatenate([[1.0], 1 - gone]))


def rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Spearman's: of the ranks of `a` and `b` (n,), equal values sharing their mean rank; 0 where
    one of them is constant.
    """
    _same_length(a, b)
    ranks = [_ranks(values) for values in (a, b)]
    deviations = [rank - rank.mean() for rank in ranks]
    length = float(np.sqrt((deviations[0] ** 2).sum() * (deviations[1] ** 2).sum()))
    return float((deviations[0] * deviations[1]).sum()) / length if length > 0 else 0.0


def _ranks(values: np.ndarray) -> np.ndarray:
    _, group, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - (count - 1) / 2)[group]


def _similarity(
    truth: np.ndarray,
    estimate: np.ndarray,
    mask: np.ndarray | None,
    peak: float,
    axes: tuple[int, ...],
) -> float:
    if (
        truth.shape != estimate.shape
        or truth.ndim != 3
        or (mask is not None and mask.shape != truth.shape[:2])
    ):
        raise ValueError(
            f"cannot compare images of shapes {truth.shape} and {estimate.shape} in a mask of {getattr(mask, 'shape', None)}"
        )
    if mask is not None and not mask.any():
        raise ValueError("the mask is empty")
    t, u = (np.asarray(image, np.float64) for image in (truth, estimate))
    mean_t, mean_u = _blurred(t, axes), _blurred(u, axes)
    product = mean_t * mean_u
    power = mean_t**2 + mean_u**2
    covariance = _blurred(t * u, axes) - product
    variances = _blurred(t * t + u * u, axes) - power
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    similarity = (2 * product + c1) * (2 * covariance + c2) / ((power + c1) * (variances + c2))
    return float((similarity if mask is None else similarity[mask]).mean())


def _blurred(values: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    for axis in axes:
        values = ndimage.correlate1d(values, _TAPS, axis=axis, mode="nearest")
    return values


def _same_length(a: np.ndarray, b: np.ndarray) -> None:
    if a.ndim != 1 or a.shape != b.shape or not len(a):
        raise ValueError(f"need two non-empty rows of the same length, not {a.shape} and {b.shape}")
