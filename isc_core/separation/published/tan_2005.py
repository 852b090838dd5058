# mypy: disable-error-code="no-untyped-def"
"""Highlight removal by comparing derivatives with a specular-free image (Tan & Ikeuchi 2005).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Separate every pixel of one
photo.

Equation: if the diffuse largest chromaticity L = max D / sum D were known, s = (max I - L sum I) /
(1 - 3 L). With one and the same L = .6 for all pixels this gives an image without specular light,
except for its colours; call its total e. Two neighbours of one reflectance are both diffuse if
their totals t = sum I vary as e does: |log |dt| - log |de|| <= epsilon, or, as published, |d log t
- d log e| <= epsilon. Where they do not, the one with the smaller c = max I / sum I has more
specular, and is given the other's c as its L. This is repeated until the number of such pairs no
longer falls; then epsilon is lowered.

Citation: R. T. Tan and K. Ikeuchi, "Separating reflection components of textured surfaces using a
single image", IEEE TPAMI 27(2), 178-193 (2005), doi:10.1109/TPAMI.2005.36. Ours, as options: no
pixel's L exceeds a quantile of c over all pixels of its colour, since otherwise the noisiest strong
colour spreads over the whole surface; reflectances are distinguished by highlight-invariant colour
(`colour_groups`); the dark guard is relative to the object's brightness; and the result is weighted
by the object's saturation (`saturation_gate`).

Limits: the light must be white. Every step of texture that is no clear change of hue is a highlight
to this method. So is white reflectance beside a coloured one of similar hue; the improved variant
therefore leaves pale objects unchanged, even where they do have highlights.
"""

import math
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...imaging.channels import largest
from ...numerics.jit import jit
from ...progress import Monitor
from ...scene.decomposition import Separation
from ..support.checks import check_arrays, require_colour
from ..support.colour_groups import colour_cells, group_quantile, two_band_shares
from ..support.layers import white_layers
from ..support.saturation_gate import saturation_gate
from ..support.specular_free import fixed_chromaticity


@dataclass(frozen=True)
class Tan2005Options:
    """Options of Tan & Ikeuchi (2005).

    Attributes
    ----------
    start, step : float
        epsilon runs from `start` to 0 in steps of `step`; start >= 0, step > 0 and at least start /
        1000.
    log_of_difference : bool
        Compare the logarithms of the differences, as the authors' program does, not the differences
        of the logarithms.
    noise : float
        Neighbours whose c differs less are left as they are; > 0.
    colour_step : float
        Neighbours have different reflectance if both their red and their green shares of the total
        differ by more than this; where `by_colour`, if either share of the two-band image does; >
        0.
    by_colour : bool
        L never exceeds the `quantile`, in [0, 1], of c over the object's pixels in the same cell of
        the plane of red and green shares of the two-band image with `cells` cells a side (1 to
        1000); `window`, odd, is the side in pixels over which they are averaged.
    quantile : float
        See `by_colour`; in [0, 1].
    cells, window : int
        See `by_colour`.
    dark : float
        Pixels whose channels are all less are left unchanged; >= 0.
    relative_dark : bool
        `dark` is a share of the object's brightness (the 99.9 % quantile of the largest channel).
    weigh_evidence : bool
        Remove less, down to nothing, the less saturated the object is, see `saturation_gate`.
    whole_frame : bool
        Use the whole frame, its last row and column only as neighbours, and dark pixels as
        neighbours, as the mask-less public implementations do.
    """

    start: float = 0.5
    step: float = 0.1
    log_of_difference: bool = True
    noise: float = 0.002
    colour_step: float = 0.1
    by_colour: bool = True
    quantile: float = 0.65
    cells: int = 20
    window: int = 3
    dark: float = 0.15
    relative_dark: bool = True
    weigh_evidence: bool = True
    whole_frame: bool = False


def _published(log_of_difference: bool, whole_frame: bool) -> Tan2005Options:
    return Tan2005Options(
        step=0.01,
        log_of_difference=log_of_difference,
        noise=0.01,
        by_colour=False,
        dark=20 / 255,
        relative_dark=False,
        weigh_evidence=False,
        whole_frame=whole_frame,
    )


VARIANTS: dict[str, Tan2005Options] = {
    "improved": Tan2005Options(),
    "paper": _published(log_of_difference=False, whole_frame=False),
    "sihr": _published(log_of_difference=True, whole_frame=True),
}

_BRIGHT_QUANTILE = 0.999
# Diffuse chromaticity of the specular-free image; any value will do.
_FREE = 0.6
# Labels of a pixel: diffuse, excluded, specular relative to the next pixel of its row or column, on
# an edge, in a uniform area.
_DIFFUSE, _DARK, _ROW, _COLUMN, _EDGE, _UNIFORM = 0, 1, 2, 3, 4, 5


@dataclass(frozen=True, eq=False)
class _Pixels:
    """State of the sweeps; all (H, W) but `colours` (H, W, 3). Each sweep changes `colours`, then,
    where `stale`, `total`, their sum, `peak`, c, and unless `by_colour` the shares `red` and
    `green`. `free`: e. `limit`: the largest L. `neighbour`: which pixels may be the second of a
    pair. `label`: as above.
    """

    colours: np.ndarray
    total: np.ndarray
    peak: np.ndarray
    red: np.ndarray
    green: np.ndarray
    free: np.ndarray
    limit: np.ndarray
    neighbour: np.ndarray
    label: np.ndarray
    stale: np.ndarray


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: Tan2005Options | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure (in [0, 1] where `dark` is absolute).
    mask : (H, W) bool ndarray
    options : Tan2005Options, optional
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
    options, monitor = options or Tan2005Options(), monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "tan_2005")
    domain = np.ones_like(mask) if options.whole_frame else mask
    inside = np.where(domain[..., None], np.nan_to_num(image), 0).astype(float)
    used = domain & _bright(inside, domain, options)
    if clipped is not None:
        used &= ~clipped
    share = saturation_gate(inside, used) if options.weigh_evidence else 1.0
    specular = np.zeros(mask.shape)
    if share > 0:
        specular = share * _specular_of(inside, used, options, monitor)
    return white_layers(np.where(mask[..., None], inside, 0), mask, specular, clipped)


def _check_options(options: Tan2005Options) -> None:
    if (
        not 0 <= options.start < math.inf
        or not options.start / 1000 <= options.step < math.inf
        or options.step <= 0
    ):
        raise InputError(
            "start must be at least 0, and step above 0 and at least a thousandth of start"
        )
    if not options.noise > 0 or not options.colour_step > 0 or not 0 <= options.dark < math.inf:
        raise InputError("noise and colour_step must be above 0, dark at least 0")
    if (
        not 0 <= options.quantile <= 1
        or not 1 <= options.cells <= 1000
        or options.window < 1
        or options.window % 2 == 0
    ):
        raise InputError(
            "quantile must lie within 0 and 1, cells within 1 and 1000, and window be an odd "
            "number of pixels"
        )


def _bright(image: np.ndarray, domain: np.ndarray, options: Tan2005Options) -> np.ndarray:
    """Which pixels (H, W) are bright enough to have a chromaticity; black ones never are."""
    high = largest(image)
    scale = float(np.quantile(high[domain], _BRIGHT_QUANTILE)) if options.relative_dark else 1.0
    return (high >= options.dark * scale) & (high > 0)


def _specular_of(
    image: np.ndarray, used: np.ndarray, options: Tan2005Options, monitor: Monitor
) -> np.ndarray:
    """Specular (H, W) of `image` (H, W, 3); zero where it is not `used` (H, W) bool."""
    shape = used.shape
    if not options.whole_frame:
        # The sweeps skip the last row and column: pad, so that these are not the object's.
        image, used = np.pad(image, [(0, 1), (0, 1), (0, 0)]), np.pad(used, [(0, 1), (0, 1)])
    pixels = _prepared(image, used, options)
    before = pixels.total.copy()
    count = math.floor(options.start / options.step + 1e-9) + 1
    for done in range(count):
        monitor.report("comparing derivatives with the specular-free image", done / count)
        _sweep_until_settled(pixels, math.exp(max(options.start - done * options.step, 0)), options)
        pixels.label[used] = _DIFFUSE
    return ((before - pixels.total) / 3)[: shape[0], : shape[1]]


def _prepared(image: np.ndarray, used: np.ndarray, options: Tan2005Options) -> _Pixels:
    total, high = image[..., 0] + image[..., 1] + image[..., 2], largest(image)
    over = np.where(total > 0, total, 1)
    peak = np.where(total > 0, high / over, 1 / 3)
    free = fixed_chromaticity(image, _FREE)
    limit = np.ones_like(total)
    if options.by_colour:
        red, green = two_band_shares(image, used, options.window)
        cells = colour_cells(red[used], green[used], options.cells)
        limit[used] = group_quantile(cells, peak[used], options.quantile)
    else:
        red, green = image[..., 0] / over, image[..., 1] / over
    neighbour = np.ones_like(used) if options.whole_frame else used
    label = np.where(used, _DIFFUSE, _DARK).astype(np.int8)
    return _Pixels(
        image.copy(),
        total,
        peak,
        red,
        green,
        free[..., 0] + free[..., 1] + free[..., 2],
        limit,
        neighbour,
        label,
        np.zeros(used.shape, np.bool_),
    )


def _sweep_until_settled(pixels: _Pixels, factor: float, options: Tan2005Options) -> None:
    """Sweep until the number of specular pairs no longer falls, for epsilon = log `factor`."""
    compare = (
        pixels.total,
        pixels.free,
        pixels.neighbour,
        pixels.label,
        factor,
        options.log_of_difference,
    )
    pairs = _mark(*compare)
    while pairs:
        _move(
            *(
                pixels.colours,
                pixels.peak,
                pixels.red,
                pixels.green,
                pixels.limit,
                pixels.label,
                pixels.stale,
            ),
            *(options.noise, options.colour_step, options.by_colour),
        )
        _refresh(
            pixels.colours,
            pixels.total,
            pixels.peak,
            pixels.red,
            pixels.green,
            pixels.stale,
            not options.by_colour,
        )
        before, pairs = pairs, _mark(*compare)
        if pairs >= before:
            break


@jit(types="f8[2] f8[2] b1[2] i1[2] f8 b1 -> i8")
def _mark(total, free, neighbour, label, factor, log_of_difference):
    """Label every open pixel as specular relative to its right or lower neighbour, or diffuse;
    return the number of specular ones.

    |log a - log b| > epsilon is a > b exp(epsilon) or b > a exp(epsilon): no logarithm, and nothing
    undefined where both are zero.
    """
    count = 0
    for y in range(total.shape[0] - 1):
        for x in range(total.shape[1] - 1):
            if label[y, x] == _DARK or label[y, x] == _EDGE or label[y, x] == _UNIFORM:
                continue
            label[y, x] = _DIFFUSE
            here, free_here = total[y, x], free[y, x]
            if neighbour[y, x + 1]:
                if log_of_difference:
                    a, b = abs(total[y, x + 1] - here), abs(free[y, x + 1] - free_here)
                else:
                    a, b = total[y, x + 1] * free_here, free[y, x + 1] * here
                if a > factor * b or b > factor * a:
                    label[y, x] = _ROW
                    count += 1
                    continue
            if neighbour[y + 1, x]:
                if log_of_difference:
                    a, b = abs(total[y + 1, x] - here), abs(free[y + 1, x] - free_here)
                else:
                    a, b = total[y + 1, x] * free_here, free[y + 1, x] * here
                if a > factor * b or b > factor * a:
                    label[y, x] = _COLUMN
                    count += 1
    return count


@jit(types="f8[3] f8[2] f8[2] f8[2] f8[2] i1[2] b1[2] f8 f8 b1")
def _move(colours, peak, red, green, limit, label, stale, noise, colour_step, by_colour):
    """Set, pair by pair, the diffuse chromaticity of the pixel with the smaller c to the other's,
    up to its limit.
    """
    for y in range(label.shape[0] - 1):
        for x in range(label.shape[1] - 1):
            if label[y, x] != _ROW and label[y, x] != _COLUMN:
                continue
            other_y, other_x = (y, x + 1) if label[y, x] == _ROW else (y + 1, x)
            redder = abs(red[other_y, other_x] - red[y, x]) > colour_step
            greener = abs(green[other_y, other_x] - green[y, x]) > colour_step
            if (redder or greener) if by_colour else (redder and greener):
                label[y, x] = _EDGE
                continue
            v, u, target = y, x, peak[other_y, other_x]
            if peak[y, x] >= target:
                v, u, target = other_y, other_x, peak[y, x]
            target = min(target, limit[v, u])
            if target - peak[v, u] < noise:
                label[y, x] = _UNIFORM
                continue
            r, g, b = colours[v, u, 0], colours[v, u, 1], colours[v, u, 2]
            white = (max(r, g, b) - target * (r + g + b)) / (1 - 3 * target)
            if min(r, g, b) - white <= 0 or (by_colour and white <= 0):
                continue
            colours[v, u, 0], colours[v, u, 1], colours[v, u, 2] = r - white, g - white, b - white
            stale[v, u] = True
            label[y, x] = _DIFFUSE
            label[other_y, other_x] = _DIFFUSE


@jit(types="f8[3] f8[2] f8[2] f8[2] f8[2] b1[2] b1")
def _refresh(colours, total, peak, red, green, stale, shares):
    """Recompute totals and chromaticities of the changed colours; `red` and `green` only if
    `shares`.
    """
    for y in range(total.shape[0]):
        for x in range(total.shape[1]):
            if not stale[y, x]:
                continue
            stale[y, x] = False
            r, g, b = colours[y, x, 0], colours[y, x, 1], colours[y, x, 2]
            total[y, x] = r + g + b
            peak[y, x] = max(r, g, b) / total[y, x]
            if shares:
                red[y, x] = r / total[y, x]
                green[y, x] = g / total[y, x]
