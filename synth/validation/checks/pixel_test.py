"""Whether an image is another up to noise: a test of every pixel, and two of all pixels together.

Problem: renders are noisy, and an error may sit in one pixel, or be far below the noise in every
one.

Equation: under the hypothesis the difference d of a pixel has the mean 0 and the variance v, known
or estimated. Each pixel's d / sqrt(v) (Student's t where v was estimated from few samples) becomes
the z of equal probability. The largest |z| of m pixels is held against the z of the level 1 - (1 -
a)^(1/m). For all pixels together, with weights w = 1 / (v averaged over the neighbours), which know
nothing of d:

    bias    sum(sqrt(w) d) / sqrt(sum(w v))                      a small shift of many pixels spread
    sum(w (d^2 - v)) / sqrt(sum(w^2 (d^2 - v)^2))        small errors of either sign, or a variance
    that claims too little

both normal where pixels are many. The level is shared: half for the pixels, a quarter for each of
the others (twice the channels of them).

Citation: Z. Sidak, "Rectangular confidence regions for the means of multivariate normal
distributions", Journal of the American Statistical Association 62, 626-633 (1967),
doi:10.1080/01621459.1967.10482935 (the level also holds where pixels, or channels, go together);
Student, "The probable error of a mean", Biometrika 6(1), 1-25 (1908), doi:10.1093/biomet/6.1.1; the
manner: W. Jakob et al., "Mitsuba 3 renderer", 2022, https://mitsuba-renderer.org (tests of its
renders).

Limits: the noise of a pixel has to be near normal in its tails: many samples, none far brighter
than all others. `pooled` makes it so. Pixels have to be independent of each other for `bias` and
`spread`.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage, stats

from isc_core.errors import InputError
from isc_core.io.atomic import new_folder
from isc_core.io.exr import write_channels

EVIDENCE = ("pixel_test.exr",)
_NEIGHBOURS = 5  # a side of the window that a pixel's weight comes from
_CHANNELS = "RGB"


@dataclass(frozen=True)
class PixelTestOptions:
    """`level`: the chance that a right image is rejected, in (0, 1). `tolerance`: >= 0, a
    difference up to this is no error, in the image's unit; the only measure where the variance is
    0. `samples`: behind each estimated variance, >= 2; infinite for a known one. Raises
    `InputError` outside these ranges.
    """

    level: float = 0.01
    tolerance: float = 0.0
    samples: float = np.inf

    def __post_init__(self) -> None:
        if not (0 < self.level < 1 and self.tolerance >= 0 and self.samples >= 2):
            raise InputError(
                "a pixel test needs a level between 0 and 1, a tolerance of 0 or more, and 2 samples or more"
            )


@dataclass(frozen=True)
class PixelTestResult:
    """`accepted`: none of the three is beyond its threshold. `worst`: the largest |z| of a pixel,
    infinite where the variance is 0 and the difference beyond the tolerance; `threshold`: of
    `worst`; `beyond`: how many values are above it, of `tested`; `where`: row, column (and channel)
    of the worst. `bias`, `spread`: of all pixels together, the channel farthest out;
    `global_threshold`: of both (`spread` counts upward only). `z`: of every value, in the image's
    shape.
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
        """One line for people."""
        place = ", ".join(map(str, self.where))
        pixels = f"worst pixel z {self.worst:.2f} at ({place}), allowed {self.threshold:.2f}, {self.beyond} of {self.tested} beyond"
        together = f"bias z {self.bias:.2f}, spread z {self.spread:.2f}, allowed {self.global_threshold:.2f}"
        return f"{'accepted' if self.accepted else 'REJECTED'}: {pixels}; {together}"


def pixel_test(
    difference: np.ndarray, variance: np.ndarray, options: PixelTestOptions | None = None
) -> PixelTestResult:
    """Tests a difference of images (H, W) or (H, W, C) against 0; `variance`: of the difference,
    same shape, >= 0.

    Raises `InputError` for other shapes, for what is not finite and for negative variances.
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
    """Means of blocks of `side` x `side` pixels of (H, W[, C]); of a `variance`, that of those
    means. What fills no block is left out.

    Pixels of a block count as independent. Raises `InputError` where not even one block fits.
    """
    rows, columns = (length // side if side > 0 else 0 for length in np.shape(values)[:2])
    if not (rows and columns):
        raise InputError(
            f"blocks of {side} pixels do not fit into a picture of shape {np.shape(values)}"
        )
    cut = np.asarray(values, float)[: rows * side, : columns * side]
    means = cut.reshape(rows, side, columns, side, *cut.shape[2:]).mean((1, 3))
    return means / side**2 if variance else means


def keep_evidence(
    folder: Path | str, difference: np.ndarray, variance: np.ndarray, result: PixelTestResult
) -> Path | None:
    """Writes FOLDER/pixel_test.exr with the channels of `difference`, `variance` and `z` if the
    result is a rejection; else nothing.

    Returns the file. An earlier evidence is replaced. Raises `InputError` where the folder holds
    anything else or cannot be written.
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
            f"difference {difference.shape} and variance {variance.shape} have to be pictures of one shape, not empty"
        )
    if not (
        np.isfinite(difference).all() and np.isfinite(variance).all() and (variance >= 0).all()
    ):
        raise InputError("a difference has to be finite, a variance finite and 0 or more")
    return difference, variance


def _equal_probability(error: np.ndarray, variance: np.ndarray, samples: float) -> np.ndarray:
    """The z of each pixel; infinite for an error without variance."""
    noisy = variance > 0
    z = np.where(error == 0, 0, np.copysign(np.inf, error))
    ratio = error[noisy] / np.sqrt(variance[noisy])
    if np.isfinite(samples):
        # In the logarithm, or what is far out would be as good as impossible: 0.
        tail = np.maximum(stats.t.sf(np.abs(ratio), samples - 1), np.finfo(float).tiny)
        ratio = np.copysign(stats.norm.isf(tail), ratio)
    z[noisy] = ratio
    return z


def _sidak(level: float, count: int) -> float:
    """The level of each of `count` tests whose family has the level."""
    return float(-np.expm1(np.log1p(-level) / count))


def _planes(image: np.ndarray) -> list[np.ndarray]:
    return (
        [image] if image.ndim == 2 else [image[..., channel] for channel in range(image.shape[2])]
    )


def _together(error: np.ndarray, variance: np.ndarray) -> tuple[float, float]:
    """The z of bias and spread of one channel, over the pixels that have noise."""
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
