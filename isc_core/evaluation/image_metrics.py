"""Structural similarity, highlight regions, and the quality of a confidence map.

Problem: measure the structural similarity of two images, the region of a photo's highlights, and
whether a confidence is low where errors are large.

Equation: structural similarity is (2 m_t m_u + C1)(2 v_tu + C2) / ((m_t^2 + m_u^2 + C1)(v_t + v_u +
C2)), means m and biased (co)variances v under a Gaussian window of sigma 1.5 and 11 taps, C1 = (.01
peak)^2, C2 = (.03 peak)^2, border values replicated, averaged. `ssim` treats each channel
separately; `ssim_volume` also runs the window across the channels, as MATLAB's `ssim` does with an
H x W x 3 array, which published figures of highlight removal use. The two differ by up to .04 and
must not be compared. Sparsification: pixels are removed in order of increasing confidence; a
meaningful confidence removes most of the error first.

Citation: Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli (2004), doi:10.1109/TIP.2003.819861.

Limits: none of the metrics is perceptual; all need the ground truth.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

_SIGMA, _RADIUS = 1.5, 5
_TAPS = np.exp(-0.5 * (np.arange(-_RADIUS, _RADIUS + 1) / _SIGMA) ** 2)
_TAPS /= _TAPS.sum()

# A pixel belongs to a highlight above this fraction of the photo's strongest specular light, which
# is a percentile.
_HIGHLIGHT_SHARE, _STRONGEST = 0.1, 99.9


def ssim(
    truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None = None, *, peak: float = 1.0
) -> float:
    """Compute the structural similarity of two images: the mean over the channels.

    Parameters
    ----------
    truth, estimate : (H, W, C) ndarray
        The images.
    mask : (H, W) ndarray of bool, optional
        The similarity is averaged inside it. Windows also cover pixels outside, so set these to the
        same value in both images.
    peak : float, optional
        Range of the values.

    Returns
    -------
    float
        1 for equal images.

    Raises
    ------
    ValueError
        If shapes differ or the mask is empty.
    """
    return _similarity(truth, estimate, mask, peak, axes=(0, 1))


def ssim_volume(
    truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray | None = None, *, peak: float = 1.0
) -> float:
    """Compute the structural similarity with the window across the channels as well.

    Parameters
    ----------
    truth, estimate : (H, W, C) ndarray
        The images, taken as volumes.
    mask : (H, W) ndarray of bool, optional
        As for `ssim`.
    peak : float, optional
        Range of the values.

    Returns
    -------
    float
        1 for equal images.

    Raises
    ------
    ValueError
        If shapes differ or the mask is empty.
    """
    return _similarity(truth, estimate, mask, peak, axes=(0, 1, 2))


def highlight_region(specular: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Find the highlights: where the mean over the channels is above a tenth of its 99.9th
    percentile.

    Parameters
    ----------
    specular : (H, W, 3) ndarray
        The true specular layer.
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    (H, W) ndarray of bool
        Empty where nothing is specular.

    Raises
    ------
    ValueError
        If the mask is empty.
    """
    if not mask.any():
        raise ValueError("the mask is empty")
    light = np.where(mask, specular.mean(axis=2), 0)
    return mask & (
        light > _HIGHLIGHT_SHARE * max(float(np.percentile(light[mask], _STRONGEST)), 0.0)
    )


@dataclass(frozen=True, eq=False)
class Sparsification:
    """The remaining error as the least confident pixels are removed.

    Attributes
    ----------
    dropped : (n,) ndarray
        Fractions of the pixels removed, from 0 to 1.
    left : (n,) ndarray
        Share of the total error in the remaining pixels, from 1 to 0.
    """

    dropped: np.ndarray
    left: np.ndarray

    @property
    def area(self) -> float:
        """The area under the curve: .5 for an uninformative confidence; lower is better, and the
        lower bound depends on the errors.
        """
        return float(((self.left[1:] + self.left[:-1]) / 2 * np.diff(self.dropped)).sum())

    def removed(self, share: float) -> float:
        """Return the share of the error in the removed pixels.

        Parameters
        ----------
        share : float
            Fraction of the pixels removed, in [0, 1].

        Returns
        -------
        float
            Share of the total error, in [0, 1].
        """
        return 1 - float(np.interp(share, self.dropped, self.left))


def sparsification(error: np.ndarray, confidence: np.ndarray) -> Sparsification:
    """Compute the sparsification curve.

    Pixels of equal confidence are removed together: each is assigned their mean error. Without any
    error, the curve is that of an uninformative confidence.

    Parameters
    ----------
    error : (n,) ndarray
        >= 0.
    confidence : (n,) ndarray
        Any scale, larger is more confident.

    Returns
    -------
    Sparsification
        The curve.

    Raises
    ------
    ValueError
        If the arrays are empty or differ in length.
    """
    _same_length(error, confidence)
    _, group, count = np.unique(confidence, return_inverse=True, return_counts=True)
    sums = np.bincount(group, weights=np.asarray(error, float))
    total = sums.sum()
    dropped = np.concatenate([[0.0], np.cumsum(count) / len(group)])
    removed_error = np.minimum(np.cumsum(sums) / total, 1) if total > 0 else dropped[1:]
    return Sparsification(dropped, np.concatenate([[1.0], 1 - removed_error]))


def rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Compute Spearman's rank correlation; ties have their mean rank.

    Parameters
    ----------
    a, b : (n,) ndarray
        The values.

    Returns
    -------
    float
        In [-1, 1]; 0 where one array is constant.

    Raises
    ------
    ValueError
        If the arrays are empty or differ in length.
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
            f"cannot compare images of shapes {truth.shape} and {estimate.shape} in a mask of "
            f"{getattr(mask, 'shape', None)}"
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
        raise ValueError(
            f"need two non-empty vectors of the same length, not {a.shape} and {b.shape}"
        )
