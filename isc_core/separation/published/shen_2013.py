"""Highlight removal by the intensity ratio of clustered pixels (Shen & Zheng 2013).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Separate every pixel of one
photo.

Equation: adding s leaves max I - min I unchanged, so the ratio r = max I / (max I - min I) is
smallest, r_D, where a surface colour shows no highlight, and s = max I - r_D (max I - min I).
Pixels of similar colour (in the smallest and largest chromaticity of I - min I + u, which hardly
depends on s) form a cluster; r_D is the median ratio of the cluster.

Citation: H.-L. Shen and Z.-H. Zheng, "Real-time highlight removal using intensity ratio", Applied
Optics 52(19), 4483-4493 (2013), doi:10.1364/AO.52.004483. u = mean(min I). Ours, as options:
statistics of the mask instead of the frame; nothing is removed where the pixels with min I > u are
too little saturated to be distinguished from white reflectance; and s fades in above u, where the
published s jumps.

Limits: the light must be white. The median assumes that highlights cover less than half of a
cluster's bright coloured pixels. A grey surface cannot be distinguished from a highlight by colour:
pale objects stay unchanged; grey pixels in the cluster of a stronger colour are darkened. There is
no spatial term, so borders of highlights can show.
"""

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...imaging.channels import fade_in, largest, saturation, smallest
from ...progress import Monitor
from ...scene.decomposition import Separation
from ..support.checks import check_arrays, require_colour
from ..support.clipped import explain_clipped
from ..support.layers import HIDDEN_SHARE


@dataclass(frozen=True)
class Shen2013Options:
    """Options of Shen & Zheng (2013).

    Attributes
    ----------
    cluster_radius : float
        L1 distance in the chromaticity plane (values in [0, 1]) within which pixels form one
        cluster; > 0.
    ratio_quantile : float
        Which quantile of a cluster's ratios is taken as the diffuse ratio, in [0, 1]; lower removes
        more.
    bright_saturation : float
        Nothing is removed if the colour (largest minus smallest channel) of the pixels with min I >
        u is less than this share of their largest channel, in [0, 1]. Zero is the published method,
        which takes pale objects for one large highlight.
    fade : float
        s grows from none at min I = u to all of it at (1 + fade) u; >= 0. Zero is the published
        method, with a jump at u.
    whole_frame : bool
        Statistics of the whole frame, as the mask-less public implementations have them, not of the
        mask.
    label_slip : bool
        Reproduce the labels of a public implementation: a pixel's cluster is the nearest one except
        the first, and the second counts as the first.
    """

    cluster_radius: float = 0.3
    ratio_quantile: float = 0.5
    bright_saturation: float = 1 / 3
    fade: float = 0.5
    whole_frame: bool = False
    label_slip: bool = False


VARIANTS: dict[str, Shen2013Options] = {
    "improved": Shen2013Options(),
    "paper": Shen2013Options(bright_saturation=0, fade=0),
    "sihr": Shen2013Options(bright_saturation=0, fade=0, whole_frame=True, label_slip=True),
}


@dataclass(frozen=True, eq=False)
class _Pixels:
    """The pixels of the mask, or of the frame, as a list: `colours` (n, 3); `high`, `low` (n,)
    largest and smallest channel; `base` is u, the mean of `low`; `usable` (n,)which pixels are
    not clipped and may enter statistics.
    """

    colours: np.ndarray
    high: np.ndarray
    low: np.ndarray
    base: np.float32
    usable: np.ndarray

    @property
    def chroma(self) -> np.ndarray:
        return self.high - self.low


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: Shen2013Options | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure.
    mask : (H, W) bool ndarray
    options : Shen2013Options, optional
        By default the improved variant.
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one.
    monitor : Monitor, optional

    Returns
    -------
    Separation
        Inside the mask 0 <= diffuse <= image; the specular layer has three equal channels; the
        residual is 0 except where clipped.

    Raises
    ------
    InputError
        If shapes or options are invalid, the mask is empty, values inside it are negative or not
        finite, or the photo has no colour.
    Cancelled
        If the user cancels.
    """
    del monitor
    options = options or Shen2013Options()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "shen_2013")
    domain = np.ones_like(mask) if options.whole_frame else mask
    pixels = _gather(image, domain, clipped)
    split = _spread(image, mask, domain, *_specular_of(pixels, options), pixels.base)
    if clipped is None:
        return split
    return explain_clipped(split, clipped & mask, mask)


def _check_options(options: Shen2013Options) -> None:
    shares = (options.ratio_quantile, options.bright_saturation)
    if (
        not options.cluster_radius > 0
        or not options.fade >= 0
        or not all(0 <= share <= 1 for share in shares)
    ):
        raise InputError(
            "cluster_radius must be above 0, fade at least 0, ratio_quantile and bright_saturation "
            "within [0, 1]"
        )


def _gather(image: np.ndarray, domain: np.ndarray, clipped: np.ndarray | None) -> _Pixels:
    # Column by column: the clusters depend on the order of the pixels, and the published figures
    # use this one.
    colours = np.asarray(image, np.float32).transpose(1, 0, 2)[domain.T]
    colours = np.where(np.isfinite(colours), colours, 0)
    usable = np.ones(len(colours), bool) if clipped is None else ~clipped.T[domain.T]
    low = smallest(colours)
    return _Pixels(colours, largest(colours), low, np.float32(low.mean(dtype=np.float64)), usable)


def _specular_of(pixels: _Pixels, options: Shen2013Options) -> tuple[np.ndarray, np.ndarray]:
    """Specular (n,) in [0, low], and its expected error (n,)."""
    specular = np.zeros_like(pixels.low)
    error = HIDDEN_SHARE * pixels.low
    bright = np.flatnonzero(pixels.low > pixels.base)
    if not len(bright) or saturation(pixels.colours[bright]) < options.bright_saturation:
        error[bright] = pixels.low[bright]
        return specular, error
    labels = _cluster(_features(pixels, bright), options)
    for label in range(labels.max() + 1):
        members = bright[labels == label]
        members = members[pixels.usable[members]]
        coloured = members[pixels.chroma[members] > pixels.base]
        if not len(coloured):
            error[members] = pixels.low[members]
            continue
        diffuse_ratio = np.quantile(
            pixels.high[coloured] / pixels.chroma[coloured], options.ratio_quantile
        )
        removed = pixels.high[members] - diffuse_ratio * pixels.chroma[members]
        specular[members] = np.clip(removed, 0, pixels.low[members]) * fade_in(
            pixels.low[members], float(pixels.base), options.fade
        )
    return specular, specular + error


def _features(pixels: _Pixels, which: np.ndarray) -> np.ndarray:
    """Smallest and largest chromaticity (m, 2) of the pseudo specular-free image I - min I + u, for
    the pixels `which` (m,).
    """
    lift = pixels.base - pixels.low[which]
    total = pixels.colours[which].sum(axis=1) + 3 * lift
    return np.stack([pixels.base / total, (pixels.high[which] + lift) / total], axis=1)


def _cluster(features: np.ndarray, options: Shen2013Options) -> np.ndarray:
    """Labels (n,) from 0: leaders in scan order collect all pixels within the radius, then each
    pixel is assigned once to the nearest mean.

    Leaders are further apart than the radius in a bounded plane, so the loop is short.
    """
    labels = np.full(len(features), -1)
    remaining = np.arange(len(features))
    count = 0
    while len(remaining):
        near = (
            np.abs(features[remaining] - features[remaining[0]]).sum(axis=1)
            <= options.cluster_radius
        )
        labels[remaining[near]] = count
        remaining = remaining[~near]
        count += 1
    means = np.stack([features[labels == k].mean(axis=0) for k in range(count)])
    distance = np.stack([np.abs(features - mean).sum(axis=1) for mean in means])
    if options.label_slip and count > 1:
        nearest = np.argmin(distance[1:], axis=0)
        return np.where(nearest > 0, nearest + 1, 0)
    return np.argmin(distance, axis=0)


def _spread(
    image: np.ndarray,
    mask: np.ndarray,
    domain: np.ndarray,
    specular: np.ndarray,
    error: np.ndarray,
    base: np.float32,
) -> Separation:
    """Write results of the domain's pixels, in column order, into the frame; zero outside the
    mask.
    """
    white = np.zeros(mask.shape, np.float32)
    white.T[domain.T] = specular
    confidence = np.zeros(mask.shape, np.float32)
    confidence.T[domain.T] = np.exp(-error / max(base, np.float32(1e-30)))
    layer = np.repeat(np.where(mask, white, 0)[..., None], 3, axis=2)
    diffuse = np.where(mask[..., None], image, 0).astype(np.float32) - layer
    return Separation(diffuse, layer, np.zeros_like(layer), np.where(mask, confidence, 0))
