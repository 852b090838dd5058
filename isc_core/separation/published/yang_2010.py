# mypy: disable-error-code="no-untyped-def"
"""Highlight removal by smoothing the largest chromaticity (Yang, Wang & Ahuja 2010).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Separate every pixel of one
photo.

Equation: if a pixel's diffuse largest chromaticity L = max D / sum D were known, s = (max I - L sum
I) / (1 - 3 L). A highlight lowers the observed one, c = max I / sum I, but not the guide g = (max I
- min I) / (sum I - 3 min I). So c is smoothed by a joint bilateral filter, which averages over
pixels that are near in the photo and in g; c rises to the average where that is higher; this is
repeated until the average exceeds it nowhere by more than a tolerance. The result is L. The filter
runs on a coarse grid over row, column and g.

Citation: Q. Yang, S. Wang and N. Ahuja, "Real-time specular highlight removal using bilateral
filtering", ECCV 2010, LNCS 6314, 87-100, doi:10.1007/978-3-642-15561-1_7. The grid is that of J.
Chen, S. Paris and F. Durand, "Real-time edge-aware image processing with the bilateral grid",
SIGGRAPH 2007, doi:10.1145/1276377.1276506. Ours, as options: the dark guard relative to the
object's brightness, nothing removed where L is grey, and the weight by the object's saturation
(`saturation_gate`).

Limits: the light must be white. Colours of similar g but different strength are averaged within a
quarter of the image, and the weaker, paler one is darkened; the improved variant therefore leaves
pale objects unchanged, even where they do have highlights.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...errors import InputError
from ...imaging.channels import largest, smallest
from ...numerics.jit import jit
from ...progress import Monitor
from ...scene.decomposition import Separation
from ..support.checks import check_arrays, require_colour
from ..support.layers import white_layers
from ..support.saturation_gate import saturation_gate


@dataclass(frozen=True)
class Yang2010Options:
    """Options of Yang, Wang & Ahuja (2010).

    Attributes
    ----------
    spatial_sigma : float
        Of the filter, as a share of the object's (or frame's) shorter side, >=
        .001.
    range_sigma : float
        Of the filter in the guide, which lies in [1/3, 1], >= .001.
    tolerance : float
        The filter is repeated while it lies this much above the largest chromaticity somewhere, >
        0.
    rounds : int
        Largest number of repetitions, >= 1.
    dark : float
        Pixels whose largest channel is less than this are left as they are and inform no other, >=
        0.
    relative_dark : bool
        `dark` is a share of the object's brightness (the 99.9 % quantile of the largest channel),
        else an absolute value.
    weigh_evidence : bool
        Remove less, down to nothing, the less saturated the object is, see `saturation_gate`.
    whole_frame : bool
        Filter the whole frame, as the mask-less public implementations do, not the mask.
    """

    spatial_sigma: float = 0.25
    range_sigma: float = 0.04
    tolerance: float = 0.03
    rounds: int = 30
    dark: float = 0.15
    relative_dark: bool = True
    weigh_evidence: bool = True
    whole_frame: bool = False


VARIANTS: dict[str, Yang2010Options] = {
    "improved": Yang2010Options(),
    "paper": Yang2010Options(dark=20 / 255, relative_dark=False, weigh_evidence=False),
    "sihr": Yang2010Options(dark=0, relative_dark=False, weigh_evidence=False, whole_frame=True),
}

_BRIGHT_QUANTILE = 0.999
# At a diffuse chromaticity this near to grey, 1/3, the specular part is undefined; it is set to 0.
_GREY = 1 / 3 + 1e-6
# Cells around the grid: one for the blur, one for the interpolation.
_MARGIN = 2


@dataclass(frozen=True, eq=False)
class BilateralGrid:
    """A grid of one cell per sigma over row, column and guide.

    Attributes
    ----------
    cells : tuple of int
        Its size.
    at : (n, 3) ndarray
        Where the pixels lie in it.
    """

    cells: tuple[int, int, int]
    at: np.ndarray


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: Yang2010Options | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure (in [0, 1] where `dark` is absolute).
    mask : (H, W) bool ndarray
    options : Yang2010Options, optional
        By default the improved variant.
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one: they do not influence others.
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
    options, monitor = options or Yang2010Options(), monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "yang_2010")
    domain = np.ones_like(mask) if options.whole_frame else mask
    inside = np.where(domain[..., None], np.nan_to_num(image), 0)
    used = domain & ~_too_dark(largest(inside), domain, options)
    if clipped is not None:
        used &= ~clipped
    specular = np.zeros(mask.shape)
    if used.any():
        specular[used] = _specular_of(inside, domain, used, options, monitor)
    if options.weigh_evidence:
        specular *= saturation_gate(inside, used)
    return white_layers(np.where(mask[..., None], inside, 0), mask, specular, clipped)


def _check_options(options: Yang2010Options) -> None:
    sound = (
        options.spatial_sigma >= 0.001
        and options.range_sigma >= 0.001
        and options.tolerance > 0
        and options.rounds >= 1
    )
    if (
        not sound
        or not options.dark >= 0
        or not math.isfinite(options.spatial_sigma + options.range_sigma)
    ):
        raise InputError(
            "spatial_sigma and range_sigma must be at least .001, tolerance above 0, rounds at "
            "least 1, dark at least 0"
        )


def _too_dark(high: np.ndarray, domain: np.ndarray, options: Yang2010Options) -> np.ndarray:
    """Which pixels (H, W) are too dark to have a chromaticity; black ones always are."""
    scale = float(np.quantile(high[domain], _BRIGHT_QUANTILE)) if options.relative_dark else 1.0
    return (high < options.dark * scale) | (high <= 0)


def _specular_of(
    image: np.ndarray,
    domain: np.ndarray,
    used: np.ndarray,
    options: Yang2010Options,
    monitor: Monitor,
) -> np.ndarray:
    """Specular (n,) of the `used` pixels of `image`, in the order of the mask."""
    colours = image[used].astype(float)
    total, high, low = colours.sum(axis=1), largest(colours), smallest(colours)
    chroma = total - 3 * low
    guide = np.where(chroma > 1e-9 * total, (high - low) / np.where(chroma > 0, chroma, 1), 1 / 3)
    grid = make_grid(domain, used, guide, options)
    diffuse = high / total
    for done in range(options.rounds):
        monitor.report("smoothing the largest chromaticity", done / options.rounds)
        smooth = filter_in_grid(diffuse, grid)
        above = float((smooth - diffuse).max())
        if above <= options.tolerance:
            break
        np.maximum(diffuse, smooth, out=diffuse)
    valid = diffuse > _GREY
    return np.where(valid, (high - diffuse * total) / np.where(valid, 1 - 3 * diffuse, 1), 0)


def make_grid(
    domain: np.ndarray, used: np.ndarray, guide: np.ndarray, options: Yang2010Options
) -> BilateralGrid:
    """Build the grid of the box around a domain: nothing depends on the space around it.

    Parameters
    ----------
    domain, used : (H, W) bool ndarray
        The domain, and the pixels of it to filter.
    guide : (n,) ndarray
        Of the used pixels, in [0, 1].
    options : Yang2010Options

    Returns
    -------
    BilateralGrid
    """
    top, bottom = np.flatnonzero(domain.any(axis=1))[[0, -1]]
    left, right = np.flatnonzero(domain.any(axis=0))[[0, -1]]
    sigma = options.spatial_sigma * (min(bottom - top, right - left) + 1)
    rows, columns = np.nonzero(used)
    at = (
        np.stack(
            [(rows - top) / sigma, (columns - left) / sigma, guide / options.range_sigma], axis=1
        )
        + _MARGIN
    )
    spans = (bottom - top) / sigma, (right - left) / sigma, 1 / options.range_sigma
    sizes = [int(span) + 2 * _MARGIN + 2 for span in spans]
    return BilateralGrid((sizes[0], sizes[1], sizes[2]), at)


def filter_in_grid(values: np.ndarray, grid: BilateralGrid) -> np.ndarray:
    """Average values over the pixels that are near in the grid.

    Parameters
    ----------
    values : (n,) ndarray
    grid : BilateralGrid

    Returns
    -------
    (n,) ndarray
    """
    sums, counts = np.zeros(grid.cells), np.zeros(grid.cells)
    _scatter(values, grid.at, sums, counts)
    kernel = np.exp([-0.5, 0.0, -0.5])
    for axis in range(3):
        sums = ndimage.correlate1d(sums, kernel, axis, mode="constant")
        counts = ndimage.correlate1d(counts, kernel, axis, mode="constant")
    smooth = np.empty_like(values)
    _interpolate(np.where(counts > 0, sums / np.maximum(counts, 1e-30), 0), grid.at, smooth)
    return smooth


@jit(types="f8[1] f8[2] f8[3] f8[3]")
def _scatter(values, at, sums, counts):
    """Add every value to its nearest cell, and one to the cell's count."""
    for i in range(len(values)):
        r, c, g = int(at[i, 0] + 0.5), int(at[i, 1] + 0.5), int(at[i, 2] + 0.5)
        sums[r, c, g] += values[i]
        counts[r, c, g] += 1.0


@jit(types="f8[3] f8[2] f8[1]")
def _interpolate(cells, at, out):
    """Trilinear interpolation of `cells` at the positions `at` (n, 3)."""
    for i in range(len(out)):
        r, c, g = int(at[i, 0]), int(at[i, 1]), int(at[i, 2])
        y, x, z = at[i, 0] - r, at[i, 1] - c, at[i, 2] - g
        near = (1 - x) * ((1 - z) * cells[r, c, g] + z * cells[r, c, g + 1]) + x * (
            (1 - z) * cells[r, c + 1, g] + z * cells[r, c + 1, g + 1]
        )
        far = (1 - x) * ((1 - z) * cells[r + 1, c, g] + z * cells[r + 1, c, g + 1]) + x * (
            (1 - z) * cells[r + 1, c + 1, g] + z * cells[r + 1, c + 1, g + 1]
        )
        out[i] = (1 - y) * near + y * far
