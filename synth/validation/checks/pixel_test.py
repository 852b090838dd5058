"""Statistical test whether two images are equal up to noise: one test per pixel, and two of all
pixels together.

Problem: renders are noisy, and an error may affect a single pixel, or be far below the noise of
each.

Equation: under the null hypothesis the difference d of a pixel has mean 0 and variance v, known or
estimated. Each pixel's d / sqrt(v) (Student's t if v was estimated from few samples) is converted
to the z of equal probability. The largest |z| of m pixels is compared with the z of the level
1 - (1 - a)^(1/m). For all pixels together, with weights w = 1 / (v averaged over the neighbours),
which are independent of d:

    bias    sum(sqrt(w) d) / sqrt(sum(w v))                  a small shift of many pixels
    spread  sum(w (d^2 - v)) / sqrt(sum(w^2 (d^2 - v)^2))    small errors of either sign, or an
                                                             underestimated variance

Both are normal for many pixels. The level is shared: half for the pixels, a quarter for each of the
others (divided by the number of channels, two-sided).

Citation: Z. Sidak, "Rectangular confidence regions for the means of multivariate normal
distributions", Journal of the American Statistical Association 62, 626-633 (1967),
doi:10.1080/01621459.1967.10482935 (the level also holds for correlated pixels or channels);
Student, "The probable error of a mean", Biometrika 6(1), 1-25 (1908), doi:10.1093/biomet/6.1.1; the
approach: W. Jakob et al., "Mitsuba 3 renderer", 2022, https://mitsuba-renderer.org (tests of its
renders).

Limits: the noise of a pixel must be nearly normal in its tails: many samples, none far brighter
than the others. `pooled` achieves that. Pixels must be independent for `bias` and `spread`.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage, stats

from isc_core.errors import InputError
from isc_core.io.atomic import new_folder
from isc_core.io.exr import write_channels

EVIDENCE = ("pixel_test.exr",)
_NEIGHBOURS = 5  # side of the window that a pixel's weight is computed from
_CHANNELS = "RGB"


@dataclass(frozen=True)
class PixelTestOptions:
    """Options of a pixel test.

    Attributes
    ----------
    level : float
        Probability that a correct image is rejected, in (0, 1).
    tolerance : float
        Differences up to this are ignored, in the image's unit, >= 0. Where the variance is 0, the
        tolerance alone decides.
    samples : float
        Samples behind each estimated variance, >= 2; infinite for a known one.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    level: float = 0.01
    tolerance: float = 0.0
    samples: float = np.inf

    def __post_init__(self) -> None:
        if not (0 < self.level < 1 and self.tolerance >= 0 and self.samples >= 2):
            raise InputError(
                "a pixel test needs a level between 0 and 1, a tolerance of at least 0 and at "
                "least 2 samples"
            )


@dataclass(frozen=True, eq=False)
class PixelTestResult:
    """Result of a pixel test.

    Attributes
    ----------
    accepted : bool
        None of the three tests exceeds its threshold.
    worst : float
        Largest |z| of a pixel; infinite where the variance is 0 and the difference exceeds the
        tolerance.
    threshold : float
        Threshold of `worst`.
    beyond, tested : int
        Number of values that exceed it, and of all values.
    where : tuple of int
        Row, column (and channel) of the worst value.
    bias, spread : float
        z of all pixels together, of the channel with the largest one.
    global_threshold : float
        Threshold of both; `spread` is one-sided.
    z : ndarray
        z of every value, in the image's shape.
    """

    accepted: bool
    worst: float
    threshold: float
    beyond: int
    tested: int
    where: tuple[int, ...]
    bias: float
    spread: float
    global_threshold: float
    z: np.ndarray

    def text(self) -> str:
        """Return the result as one line."""
        place = ", ".join(map(str, self.where))
        pixels = (
            f"worst pixel z {self.worst:.2f} at ({place}), allowed {self.threshold:.2f}, "
            f"{self.beyond} of {self.tested} beyond"
        )
        together = (
            f"bias z {self.bias:.2f}, spread z {self.spread:.2f}, "
            f"allowed {self.global_threshold:.2f}"
        )
        return f"{'accepted' if self.accepted else 'REJECTED'}: {pixels}; {together}"


def pixel_test(
    difference: np.ndarray, variance: np.ndarray, options: PixelTestOptions | None = None
) -> PixelTestResult:
    """Test whether a difference of images is 0 up to noise.

    Parameters
    ----------
    difference : (H, W) or (H, W, C) ndarray
        The difference, finite.
    variance : ndarray of the same shape
        Variance of the difference, >= 0.
    options : PixelTestOptions, optional
        Level, tolerance and samples.

    Returns
    -------
    PixelTestResult
        The result.

    Raises
    ------
    InputError
        For other shapes, non-finite values or negative variances.
    """
    options = options or PixelTestOptions()
    difference, variance = _checked(difference, variance)
    error = np.sign(difference) * np.maximum(np.abs(difference) - options.tolerance, 0)
    z = _equal_probability(error, variance, options.samples)
    tested = max(1, int((variance > 0).sum()))
    threshold = float(stats.norm.isf(_sidak(options.level / 2, tested) / 2))
    planes = list(zip(_planes(error), _planes(variance), strict=True))
    together = np.array([_together(error, variance) for error, variance in planes])
    global_threshold = float(stats.norm.isf(options.level / 4 / len(planes) / 2))
    bias = float(together[np.argmax(np.abs(together[:, 0])), 0])
    spread = float(together[:, 1].max())
    beyond = int((np.abs(z) > threshold).sum())
    where = tuple(int(part) for part in np.unravel_index(int(np.argmax(np.abs(z))), z.shape))
    accepted = not beyond and abs(bias) <= global_threshold and spread <= global_threshold
    worst = float(np.abs(z).max())
    return PixelTestResult(
        accepted, worst, threshold, beyond, z.size, where, bias, spread, global_threshold, z
    )


def pooled(values: np.ndarray, side: int, *, variance: bool = False) -> np.ndarray:
    """Average blocks of pixels; incomplete blocks at the edges are dropped.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
        An image, or the variance of one with independent pixels.
    side : int
        Side of the square blocks in pixels.
    variance : bool, optional
        Whether `values` is a variance.

    Returns
    -------
    (H // side, W // side[, C]) ndarray
        The means, or their variance.

    Raises
    ------
    InputError
        If not even one block fits.
    """
    rows, columns = (length // side if side > 0 else 0 for length in np.shape(values)[:2])
    if not (rows and columns):
        raise InputError(
            f"blocks of {side} pixels do not fit into an image of shape {np.shape(values)}"
        )
    cut = np.asarray(values, float)[: rows * side, : columns * side]
    means = cut.reshape(rows, side, columns, side, *cut.shape[2:]).mean((1, 3))
    return means / side**2 if variance else means


def keep_evidence(
    folder: Path | str, difference: np.ndarray, variance: np.ndarray, result: PixelTestResult
) -> Path | None:
    """Write the maps of a rejected test to `pixel_test.exr`.

    Parameters
    ----------
    folder : Path or str
        The folder to write; an earlier file of this kind is replaced.
    difference, variance : ndarray
        As tested.
    result : PixelTestResult
        The result.

    Returns
    -------
    Path or None
        The file; None if the test was accepted and nothing was written.

    Raises
    ------
    InputError
        If the folder has other files or cannot be written.
    """
    if result.accepted:
        return None
    channels: dict[str, np.ndarray] = {}
    for name, image in (
        ("difference", difference),
        ("variance", variance),
        ("z", np.clip(result.z, -1e30, 1e30)),
    ):
        planes = _planes(np.asarray(image, float))
        letters = (
            _CHANNELS if len(planes) == len(_CHANNELS) else ["Y", *map(str, range(1, len(planes)))]
        )
        channels |= {
            f"{name}.{letter}": plane for letter, plane in zip(letters, planes, strict=True)
        }
    with new_folder(folder, EVIDENCE) as partial:
        write_channels(partial / EVIDENCE[0], channels)
    return Path(folder) / EVIDENCE[0]


def _checked(difference: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    difference, variance = np.asarray(difference, float), np.asarray(variance, float)
    if difference.ndim not in (2, 3) or difference.shape != variance.shape or not difference.size:
        raise InputError(
            f"difference {difference.shape} and variance {variance.shape} must be non-empty images "
            "of one shape"
        )
    if not (
        np.isfinite(difference).all() and np.isfinite(variance).all() and (variance >= 0).all()
    ):
        raise InputError("a difference must be finite, a variance finite and at least 0")
    return difference, variance


def _equal_probability(error: np.ndarray, variance: np.ndarray, samples: float) -> np.ndarray:
    """The z of each pixel; infinite for an error where the variance is 0."""
    noisy = variance > 0
    z = np.where(error == 0, 0, np.copysign(np.inf, error))
    ratio = error[noisy] / np.sqrt(variance[noisy])
    if np.isfinite(samples):
        # Clamped to the smallest normal number: a tail probability of 0 would become an infinite z.
        tail = np.maximum(stats.t.sf(np.abs(ratio), samples - 1), np.finfo(float).tiny)
        ratio = np.copysign(stats.norm.isf(tail), ratio)
    z[noisy] = ratio
    return z


def _sidak(level: float, count: int) -> float:
    """Level of each of `count` tests with a common level."""
    return float(-np.expm1(np.log1p(-level) / count))


def _planes(image: np.ndarray) -> list[np.ndarray]:
    return (
        [image] if image.ndim == 2 else [image[..., channel] for channel in range(image.shape[2])]
    )


def _together(error: np.ndarray, variance: np.ndarray) -> tuple[float, float]:
    """The z of bias and spread of one channel, over the pixels with noise."""
    noisy = variance > 0
    if not noisy.any():
        return 0.0, 0.0
    window = np.ones((_NEIGHBOURS, _NEIGHBOURS))
    window[_NEIGHBOURS // 2, _NEIGHBOURS // 2] = 0
    around = [
        ndimage.convolve(values, window, mode="constant")
        for values in (variance, noisy.astype(float))
    ]
    nearby = np.where(around[1] > 0.5, around[0] / np.maximum(around[1], 1), variance[noisy].mean())
    d, v, w = error[noisy], variance[noisy], 1 / np.maximum(nearby[noisy], np.finfo(float).tiny)
    excess = w * (d * d - v)
    return (
        float((np.sqrt(w) * d).sum() / np.sqrt((w * v).sum())),
        float(excess.sum() / max(np.sqrt((excess * excess).sum()), np.finfo(float).tiny)),
    )
