# mypy: disable-error-code="no-untyped-def"
"""Highlight removal by ratios of neighbours in the two-band image (Yoon, Choi & Kweon 2006).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Separate every pixel of one
photo.

Equation: the two-band image F = I - min I, f = sum F, has no highlights. Where neighbours p, q have
one surface colour, that is nearly the same F / f, the diffuse totals relate as f(p) / f(q); so if
sum I(p) / f(p) exceeds sum I(q) / f(q), then p has more specular, and s(p) grows until the two are
equal. Repeated along all pairs, this gives every pixel the smallest t = sum I / f of the region
that it is connected to by pairs of similar colour: s = (sum I - t f) / 3.

Citation: K.-J. Yoon, Y. Choi and I. S. Kweon, "Fast separation of reflection components using a
specularity-invariant image representation", ICIP 2006, 973-976, doi:10.1109/ICIP.2006.312650. Ours,
as options: the regions are found at once, by union-find, instead of by sweeps; t is a quantile over
the region's pixels of similar colour, since the smallest of all is noise; F is averaged over a few
pixels before colours are compared; the dark guard is relative to the object's brightness; and the
result is weighted by the object's saturation (`saturation_gate`).

Limits: the light must be white. A region may leak where one colour fades into another. White
reflectance beside a coloured one of similar hue is a highlight to this method; the improved variant
therefore leaves pale objects unchanged, even where they do have highlights.
"""

import math
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...imaging.channels import largest, smallest
from ...numerics.jit import jit
from ...progress import Monitor
from ...scene.decomposition import Separation
from ..support.checks import check_arrays, require_colour
from ..support.colour_groups import colour_cells, group_quantile, two_band_shares
from ..support.layers import white_layers
from ..support.saturation_gate import saturation_gate


@dataclass(frozen=True)
class Yoon2006Options:
    """Options of Yoon, Choi & Kweon (2006).

    Attributes
    ----------
    colour_step : float
        Neighbours are of one colour if red and green shares of F, in [0, 1], both differ by no more
        than this; > 0.
    dark : float
        A pair is compared if the smallest channel of its first pixel is at least this; >= 0.
    relative_dark : bool
        Compare a pair if the largest channels of both pixels are at least `dark` times the object's
        brightness (the 99.9 % quantile of the largest channel).
    regions : bool
        Solve by regions; then `quantile` in [0, 1] of t is taken over a region's pixels that share
        a cell of the (red, green) plane of F's shares with `cells` cells a side (1 to 1000), and
        `window`, odd, is the side in pixels of the square over which F is averaged before. Else
        sweep along the pairs at most `sweeps` times, until nothing of more than `tolerance`
        (absolute) is moved; >= 0.
    quantile : float
        See `regions`.
    cells, window : int
        See `regions`.
    sweeps : int
        See `regions`.
    tolerance : float
        See `regions`; >= 0.
    toolbox_order : bool
        Pairs only along columns, with an off-by-one at the end of a column and pairs that join
        columns, to reproduce a public toolbox.
    weigh_evidence : bool
        Remove less, down to nothing, the less saturated the object is, see `saturation_gate`.
    whole_frame : bool
        Use the whole frame, as the mask-less public implementations do, not the mask.
    """

    colour_step: float = 0.1
    dark: float = 0.15
    relative_dark: bool = True
    regions: bool = True
    quantile: float = 0.35
    cells: int = 10
    window: int = 3
    sweeps: int = 1000
    tolerance: float = 1e-3
    toolbox_order: bool = False
    weigh_evidence: bool = True
    whole_frame: bool = False


_PAPER = Yoon2006Options(
    colour_step=0.05,
    dark=12 / 255,
    relative_dark=False,
    regions=False,
    window=1,
    weigh_evidence=False,
)
VARIANTS: dict[str, Yoon2006Options] = {
    "improved": Yoon2006Options(),
    "paper": _PAPER,
    "sihr": Yoon2006Options(
        colour_step=0.05,
        dark=12 / 255,
        relative_dark=False,
        regions=False,
        window=1,
        toolbox_order=True,
        weigh_evidence=False,
        whole_frame=True,
    ),
}

_BRIGHT_QUANTILE = 0.999
# Two-band images below this share of the total have no colour to compare.
_GREY = 1e-6


@dataclass(frozen=True, eq=False)
class _TwoBand:
    """Per pixel (H, W): `ratio` t = sum I / f, 0 where it is not `valid`; `band` f; `red`, `green`,
    the shares of F; `valid`, whether the pixel has a colour; `first`, whether
    it may be the first of a pair.
    """

    ratio: np.ndarray
    band: np.ndarray
    red: np.ndarray
    green: np.ndarray
    valid: np.ndarray
    first: np.ndarray


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: Yoon2006Options | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure (in [0, 1] where `dark` and `tolerance` are
        absolute).
    mask : (H, W) bool ndarray
    options : Yoon2006Options, optional
        By default the improved variant.
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one: they are compared with no other.
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
    options, monitor = options or Yoon2006Options(), monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "yoon_2006")
    domain = np.ones_like(mask) if options.whole_frame else mask
    inside = np.where(domain[..., None], np.nan_to_num(image), 0).astype(float)
    pixels = _two_band(inside, domain, domain if clipped is None else domain & ~clipped, options)
    monitor.report("comparing neighbours", 0.0)
    ratio = (
        _by_regions(pixels, options) if options.regions else _by_sweeps(pixels, options, monitor)
    )
    total = inside[..., 0] + inside[..., 1] + inside[..., 2]
    specular = np.where(pixels.valid, (total - ratio * (total - 3 * smallest(inside))) / 3, 0)
    if options.weigh_evidence:
        specular *= saturation_gate(inside, pixels.valid)
    return white_layers(np.where(mask[..., None], inside, 0), mask, specular, clipped)


def _check_options(options: Yoon2006Options) -> None:
    if (
        not 0 < options.colour_step < math.inf
        or not 0 <= options.dark < math.inf
        or not 0 <= options.quantile <= 1
    ):
        raise InputError("colour_step must be above 0, dark at least 0, quantile within [0, 1]")
    if not 1 <= options.cells <= 1000 or options.window < 1 or options.window % 2 == 0:
        raise InputError("cells must lie within 1 and 1000, and window be an odd number of pixels")
    if options.sweeps < 0 or not options.tolerance >= 0:
        raise InputError("sweeps and tolerance must be at least 0")


def _two_band(
    image: np.ndarray, domain: np.ndarray, usable: np.ndarray, options: Yoon2006Options
) -> _TwoBand:
    low, high = smallest(image), largest(image)
    total = image[..., 0] + image[..., 1] + image[..., 2]
    band = total - 3 * low
    valid = usable & (band > _GREY * total)
    if options.relative_dark:
        valid &= high >= options.dark * np.quantile(high[domain], _BRIGHT_QUANTILE)
        first = valid
    else:
        first = valid & (low >= options.dark)
    ratio = np.where(valid, total / np.where(valid, band, 1), 0)
    red, green = two_band_shares(image, valid, options.window)
    return _TwoBand(ratio, band, red, green, valid, first)


def _by_regions(pixels: _TwoBand, options: Yoon2006Options) -> np.ndarray:
    """t (H, W), for every known pixel the quantile over the pixels of its region and cell of
    colour.
    """
    parent = np.arange(pixels.valid.size, dtype=np.int64)
    for first, second in (_pairs(pixels, options.colour_step, axis) for axis in (1, 0)):
        _unite(first, second, parent)
    _flatten(parent)
    valid = pixels.valid
    cell = colour_cells(pixels.red[valid], pixels.green[valid], options.cells)
    group = parent[valid.ravel()] * options.cells**2 + cell
    ratio = np.zeros(valid.shape)
    ratio[valid] = group_quantile(group, pixels.ratio[valid], options.quantile)
    return ratio


def _by_sweeps(pixels: _TwoBand, options: Yoon2006Options, monitor: Monitor) -> np.ndarray:
    """t (H, W) after sweeps along the pairs until no pixel changes."""
    if options.toolbox_order:
        transposed = (np.ascontiguousarray(array.T) for array in vars(pixels).values())
        pixels = _TwoBand(*transposed)
        pair_lists = [_column_pairs(pixels, options.colour_step)]
    else:
        pair_lists = [_pairs(pixels, options.colour_step, axis) for axis in (1, 0)]
    ratio, band = pixels.ratio.ravel().copy(), pixels.band.ravel()
    for done in range(options.sweeps):
        monitor.report("comparing neighbours", done / options.sweeps)
        if not sum(
            _sweep(first, second, ratio, band, options.tolerance) for first, second in pair_lists
        ):
            break
    ratio = ratio.reshape(pixels.valid.shape)
    return ratio.T if options.toolbox_order else ratio


def _pairs(pixels: _TwoBand, colour_step: float, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Flat indices of the pixels whose colour matches the next one's along the axis, and of
    those neighbours.
    """
    here, there = (np.s_[:-1], np.s_[1:]) if axis == 0 else (np.s_[:, :-1], np.s_[:, 1:])
    like = pixels.first[here] & pixels.valid[there]
    for share in (pixels.red, pixels.green):
        like &= np.abs(share[here] - share[there]) <= colour_step
    rows, columns = np.nonzero(like)
    width = pixels.valid.shape[1]
    first = rows * width + columns
    return first, first + (width if axis == 0 else 1)


def _column_pairs(pixels: _TwoBand, colour_step: float) -> tuple[np.ndarray, np.ndarray]:
    """The pairs of transposed arrays as one line of columns, without pairs across the end of a
    column.
    """
    line = _TwoBand(*(array.reshape(1, -1) for array in vars(pixels).values()))
    first, second = _pairs(line, colour_step, axis=1)
    kept = second % pixels.valid.shape[0] != 0
    return first[kept], second[kept]


@jit(types="i8[1] i8[1] f8[1] f8[1] f8 -> i8")
def _sweep(first, second, ratio, band, tolerance):
    """Lower the larger t of each pair to the smaller one, in order, where more than `tolerance` of
    light changes; return the number of changes.
    """
    moved = 0
    for k in range(len(first)):
        p, q = first[k], second[k]
        excess = ratio[p] - ratio[q]
        if excess * band[p] >= tolerance and excess > 0:
            ratio[p] = ratio[q]
            moved += 1
        elif -excess * band[q] >= tolerance and excess < 0:
            ratio[q] = ratio[p]
            moved += 1
    return moved


@jit(types="i8[1] i8[1] i8[1]")
def _unite(first, second, parent):
    """Join the trees of every pair, with path halving; the root is the tree's smallest index."""
    for k in range(len(first)):
        p, q = first[k], second[k]
        while parent[p] != p:
            parent[p] = parent[parent[p]]
            p = parent[p]
        while parent[q] != q:
            parent[q] = parent[parent[q]]
            q = parent[q]
        if p < q:
            parent[q] = p
        else:
            parent[p] = q


@jit(types="i8[1]")
def _flatten(parent):
    """Point every node at its root; a node's parent never comes after it."""
    for i in range(len(parent)):
        parent[i] = parent[parent[i]]
