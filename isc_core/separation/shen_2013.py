"""Removes highlights by the intensity ratio of clustered pixels (Shen & Zheng 2013).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Split every pixel of one photo.

Equation: adding s leaves max I - min I alone, so the ratio r = max I / (max I - min I) is smallest, r_D, where a surface
colour shows no highlight, and s = max I - r_D (max I - min I). Pixels with like colours (in the smallest and largest
chromaticity of I - min I + u, which hardly depends on s) form a cluster; r_D is the median ratio of the cluster.

Citation: H.-L. Shen and Z.-H. Zheng, "Real-time highlight removal using intensity ratio", Applied Optics 52(19), 4483-4493
(2013), doi:10.1364/AO.52.004483. Here u = mean(min I) and all other statistics are taken inside the mask alone.

Limits: the light must be white. The median assumes that highlights cover less than half of a cluster's bright coloured pixels. A
grey surface cannot be told from a highlight by colour: a cluster with too few coloured pixels is left as it is; grey paint in the
cluster of a stronger colour is darkened. There is no spatial term, so borders of highlights can show.
"""

from dataclasses import dataclass

import numpy as np

from ..decomposition import Separation
from ..errors import InputError
from .checks import check_arrays
from .clipped import explain_clipped


@dataclass(frozen=True)
class Shen2013Options:
    """`cluster_radius`: L1 distance in the chromaticity plane (values in [0, 1]) within which pixels found one cluster; > 0.
    `ratio_quantile`: which quantile of a cluster's ratios is taken as the diffuse ratio, in [0, 1]; lower removes more.
    `coloured_share`: a cluster with a smaller share of clearly coloured pixels is left as it is, in [0, 1]. Zero is the
    published method, which takes bright near-grey objects for one large highlight.
    """

    cluster_radius: float = 0.3
    ratio_quantile: float = 0.5
    coloured_share: float = 1 / 3


# A highlight can hide in a pixel's smallest channel; the share of it that stays in doubt where the method could decide.
_DOUBT = 0.3


@dataclass(frozen=True)
class _Pixels:
    """The pixels of the mask in a row: `colours` (n, 3); `high`, `low` (n,) largest and smallest channel; `base` is u, the mean
    of `low`; `usable` (n,) which of them are linear, i.e. not clipped, and may enter statistics."""

    colours: np.ndarray
    high: np.ndarray
    low: np.ndarray
    base: np.float32
    usable: np.ndarray

    @property
    def chroma(self) -> np.ndarray:
        return self.high - self.low


def separate(image: np.ndarray, mask: np.ndarray, options: Shen2013Options | None = None, clipped: np.ndarray | None = None) -> Separation:
    """Splits a photo under white light into diffuse and specular.

    `image` (H, W, 3), linear, >= 0, any scale; `mask` (H, W) bool; `clipped` (H, W) bool marks pixels whose true value lies
    above what was recorded. Inside the mask 0 <= diffuse <= image and specular has three equal channels.

    The residual is zero except in clipped bright pixels: the method's equation does not hold there, so they stay out of the
    statistics, their diffuse part comes from around them, and the light that the full channels lost is the residual (<= 0).

    Confidence is exp(-e / u), e being the specular error to be expected: what was removed plus .3 min I, all of min I where a
    cluster was too grey to judge; 0 where clipped. From an achromatic photo nothing is removed.

    Raises `InputError` for unfit shapes or options, an empty mask, or values inside the mask that are negative or not finite.
    """
    options = options or Shen2013Options()
    check_arrays(image, mask, clipped)
    _check_options(options)
    # Column by column: which pixel founds a cluster depends on the order, and the published figures come from this one.
    colours = np.asarray(image, np.float32).transpose(1, 0, 2)[mask.T]
    usable = np.ones(len(colours), bool) if clipped is None else ~clipped.T[mask.T]
    low = colours.min(axis=1)
    pixels = _Pixels(colours, colours.max(axis=1), low, np.float32(low.mean(dtype=np.float64)), usable)
    split = _spread(image, mask, *_specular_of(pixels, options), pixels.base)
    if clipped is None:
        return split
    return explain_clipped(split, clipped & mask & (np.min(image, axis=2) > pixels.base), mask)


def _check_options(options: Shen2013Options) -> None:
    if not options.cluster_radius > 0 or not 0 <= options.ratio_quantile <= 1 or not 0 <= options.coloured_share <= 1:
        raise InputError("cluster_radius must be above 0, ratio_quantile and coloured_share within [0, 1]")


def _specular_of(pixels: _Pixels, options: Shen2013Options) -> tuple[np.ndarray, np.ndarray]:
    """Specular (n,) in [0, low], and the error (n,) to be expected of it."""
    specular = np.zeros_like(pixels.low)
    doubt = _DOUBT * pixels.low
    bright = np.flatnonzero(pixels.low > pixels.base)
    if not len(bright):
        return specular, doubt
    labels = _cluster(_features(pixels, bright), options.cluster_radius)
    for label in range(labels.max() + 1):
        members = bright[labels == label]
        members = members[pixels.usable[members]]
        telling = members[pixels.chroma[members] > pixels.base]
        if not len(telling) or len(telling) < options.coloured_share * len(members):
            doubt[members] = pixels.low[members]
            continue
        diffuse_ratio = np.quantile(pixels.high[telling] / pixels.chroma[telling], options.ratio_quantile)
        removed = pixels.high[members] - diffuse_ratio * pixels.chroma[members]
        specular[members] = np.clip(removed, 0, pixels.low[members])
    return specular, specular + doubt


def _features(pixels: _Pixels, which: np.ndarray) -> np.ndarray:
    """Smallest and largest chromaticity (m, 2) of the pseudo specular-free image I - min I + u, for the pixels `which` (m,)."""
    lift = pixels.base - pixels.low[which]
    total = pixels.colours[which].sum(axis=1) + 3 * lift
    return np.stack([pixels.base / total, (pixels.high[which] + lift) / total], axis=1)


def _cluster(features: np.ndarray, radius: float) -> np.ndarray:
    """Labels (n,) from 0: leaders in scan order gather all within `radius`, then every pixel goes to the nearest mean, once.

    Leaders lie further apart than the radius in a bounded plane, so there are only a few, and the loop is short.
    """
    labels = np.full(len(features), -1)
    open_ = np.arange(len(features))
    count = 0
    while len(open_):
        near = np.abs(features[open_] - features[open_[0]]).sum(axis=1) <= radius
        labels[open_[near]] = count
        open_ = open_[~near]
        count += 1
    means = np.stack([features[labels == k].mean(axis=0) for k in range(count)])
    distance = np.stack([np.abs(features - mean).sum(axis=1) for mean in means])
    return np.argmin(distance, axis=0)


def _spread(image: np.ndarray, mask: np.ndarray, specular: np.ndarray, error: np.ndarray, base: np.float32) -> Separation:
    """Puts per-pixel results, in column order, back into the frame, zero outside the mask."""
    layer = np.zeros(image.shape, np.float32)
    layer.transpose(1, 0, 2)[mask.T] = specular[:, None]
    diffuse = np.where(mask[..., None], image, 0).astype(np.float32) - layer
    confidence = np.zeros(mask.shape, np.float32)
    confidence.T[mask.T] = np.exp(-error / max(base, np.float32(1e-30)))
    return Separation(diffuse=diffuse, specular=layer, residual=np.zeros_like(layer), confidence=confidence)
