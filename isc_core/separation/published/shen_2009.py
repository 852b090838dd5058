"""Highlight removal by one gain for the modified specular-free image (Shen & Cai 2009).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Separate every pixel of one
photo.

Equation: the smallest channel exceeds a threshold T = mean(min I) + eta std(min I) mostly in
highlights, so b = max(min I - T, 0) is the specular image up to a gain, s = k b. The diffuse colour
is continuous across the rim of a highlight: with Omega the largest region of b and R a thin ring
around it,

    k = min over channels of (mean I in Omega - mean I in R) / (mean b in Omega - mean b in R).

Citation: H.-L. Shen and Q.-Y. Cai, "Simple and efficient method for specularity removal in an
image", Applied Optics 48(14), 2711-2719 (2009), doi:10.1364/AO.48.002711. Ours, as options that the
published method lacks: every region has its own gain and, in place of T, its own level, the
smallest channel of its ring's mean colour; and nothing is removed where the bright pixels are too
little saturated to be distinguished from white reflectance.

Limits: the light must be white. A highlight is anything bright and pale: white and grey reflectance
is one too, which is why the improved variant leaves pale objects unchanged, even where they do have
highlights. Each region has one level and one gain.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...errors import InputError
from ...imaging.channels import saturation, smallest
from ...progress import Monitor
from ...scene.decomposition import Separation
from ..support.checks import check_arrays, require_colour
from ..support.layers import white_layers


@dataclass(frozen=True)
class Shen2009Options:
    """Options of Shen & Cai (2009).

    Attributes
    ----------
    deviations : float
        eta, how many standard deviations the threshold T lies above the mean of the smallest
        channel; finite.
    region_share : float
        A region is where b exceeds this share of its largest value, in [0, 1).
    ring_width : int
        Side of the square, in pixels, by which a region is widened to find its ring; odd, >= 3.
    every_region : bool
        Each region has its own gain and level. Else one gain, the largest region's, and one level,
        T, hold everywhere.
    bright_saturation : float
        Nothing is removed if the colour (largest minus smallest channel) of the pixels whose
        smallest channel is above the mean is less than this share of their largest channel, in [0,
        1]. Zero always removes, like the published method.
    whole_frame : bool
        Statistics and regions of the whole frame, as the mask-less public implementations have
        them, not of the mask.
    """

    deviations: float = 0.5
    region_share: float = 0.1
    ring_width: int = 9
    every_region: bool = True
    bright_saturation: float = 1 / 3
    whole_frame: bool = False


_PAPER = Shen2009Options(ring_width=5, every_region=False, bright_saturation=0)
VARIANTS: dict[str, Shen2009Options] = {
    "improved": Shen2009Options(),
    "paper": _PAPER,
    "sihr": Shen2009Options(
        ring_width=5, every_region=False, bright_saturation=0, whole_frame=True
    ),
}

_EIGHT = np.ones((3, 3), bool)


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: Shen2009Options | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure.
    mask : (H, W) bool ndarray
    options : Shen2009Options, optional
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
    options = options or Shen2009Options()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "shen_2009")
    domain = np.ones_like(mask) if options.whole_frame else mask
    inside = np.where(domain[..., None] & np.isfinite(image), image, 0)
    usable = domain if clipped is None else domain & ~clipped
    return white_layers(
        np.where(mask[..., None], image, 0),
        mask,
        _specular_of(inside, domain, usable, options),
        clipped,
    )


def _check_options(options: Shen2009Options) -> None:
    if (
        not np.isfinite(options.deviations)
        or not 0 <= options.region_share < 1
        or not 0 <= options.bright_saturation <= 1
    ):
        raise InputError(
            "deviations must be finite, region_share within [0, 1), bright_saturation within [0, 1]"
        )
    if options.ring_width < 3 or options.ring_width % 2 == 0:
        raise InputError("ring_width must be an odd number of pixels, at least 3")


def _specular_of(
    image: np.ndarray, domain: np.ndarray, usable: np.ndarray, options: Shen2009Options
) -> np.ndarray:
    """Specular (H, W) of `image` (H, W, 3), zero outside `domain`; means are taken over the
    `usable` pixels of the domain.
    """
    low = smallest(image).astype(float)
    level = _threshold(low[domain], options.deviations)
    above = domain & (low > level)
    bright = domain & (low > low[domain].mean())
    if not above.any() or saturation(image[bright]) < options.bright_saturation:
        return np.zeros_like(low)
    excess = np.where(above, low - level, 0)
    regions, count = ndimage.label(above & (excess > options.region_share * excess.max()), _EIGHT)
    if not options.every_region:
        largest = 1 + np.bincount(regions[regions > 0] - 1).argmax()
        inside, ring = _means(
            image, excess, (regions == largest).astype(np.int32), 1, usable, options.ring_width
        )
        return _gains(inside, ring)[1] * excess
    inside, ring = _means(image, low, regions, count, usable, options.ring_width)
    levels = ring[:, :3].min(axis=1)
    inside[:, 3] -= levels  # the excess over the region's own level, which is 0 in its ring
    ring[:, 3] = 0
    nearest = _nearest_regions(regions, above)
    return np.where(
        nearest > 0, _gains(inside, ring)[nearest] * np.maximum(low - levels[nearest], 0), 0
    )


def _threshold(low: np.ndarray, deviations: float) -> float:
    spread = low.std(ddof=1) if len(low) > 1 else 0.0
    return float(low.mean() + deviations * spread)


def _means(
    image: np.ndarray,
    excess: np.ndarray,
    regions: np.ndarray,
    count: int,
    usable: np.ndarray,
    width: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean colour and excess (count + 1, 4) of each region, 1 to `count`, and of its ring; NaN
    where there is no usable pixel.

    Where rings of neighbouring regions meet, the pixel belongs to the one with the higher number;
    it is never inside a region.
    """
    around = np.where(regions > 0, 0, ndimage.maximum_filter(regions, width, mode="nearest"))
    values = np.concatenate([image, excess[..., None]], axis=2)
    means = []
    for labels in (regions, around):
        which = usable & (labels > 0)
        size = np.bincount(labels[which], minlength=count + 1)
        total = np.stack(
            [np.bincount(labels[which], values[..., c][which], count + 1) for c in range(4)], axis=1
        )
        means.append(np.where(size[:, None] > 0, total / np.maximum(size, 1)[:, None], np.nan))
    return means[0], means[1]


def _gains(inside: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """The gain k >= 0 of each region, from means (n, 4) of colour and excess; zero where a region
    or its ring is unknown.
    """
    step = inside - ring
    valid = step[:, 3] > 0
    rise = np.where(valid, step[:, :3].min(axis=1), 0)
    return np.where(valid, np.maximum(rise, 0) / np.where(valid, step[:, 3], 1), 0)


def _nearest_regions(regions: np.ndarray, above: np.ndarray) -> np.ndarray:
    """The number of the nearest connected region for each pixel (H, W) `above` the threshold,
    else 0.
    """
    nearest = ndimage.distance_transform_edt(
        regions == 0, return_distances=False, return_indices=True
    )
    islands, _ = ndimage.label(above, _EIGHT)
    connected = above & (islands == islands[tuple(nearest)])
    return np.where(connected, regions[tuple(nearest)], 0)
