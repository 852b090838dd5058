"""Highlight removal by sparse coding over a dictionary from specular-free images (SC; Akbar 2016).

Problem: a pixel is diffuse plus white specular. Write it as a code over one diffuse atom, the
colour of the reflectance, and the highlight atom.

Equation: in CIE XYZ, y = M I, the highlight atom is h = M (1, 1, 1) / |M (1, 1, 1)|. A
specular-free image removes white until the rest does not depend on the specular light: SF1 until
the largest chromaticity has a fixed value (Tan & Ikeuchi), which keeps the hue, SF2 until the
smallest channel is 0 (two-band), which keeps the magnitude too. All have the same component F
across h as the photo; alpha = |F|, t = h.y. The dictionary has an atom a_k = F / |F| + R_k h for
every hue k, with R_k a quantile of t / alpha over its pixels: the value of the reflectance alone.
So

    y = alpha a_k + beta h,     beta = max(0, t - R_k alpha),     diffuse = y - beta h.

The code is sparse: beta is 0 except where beta > lambda t, and a group switches it on as a whole or
not at all. A group is a connected region of active pixels without an edge of the specular-free
images in it. White reflectance raises beta as well, but F changes with it; a highlight has edges
that F does not show, and F has edges that beta does not show. A group's code is weighted by the
product of six ramps, see `_group_gains`: what cannot be identified is left unchanged.
docs/methods/sparse_coding.md derives all of it.

Citation: H. Akbar, "3D Intrinsic Scene Characteristics Extraction Framework for a Single Image",
thesis (2016), of which only the outline (photo, n specular-free images, dictionary, sparse code,
diffuse and specular) is public; the equations here are ours and so are the groups. SF1: R. T. Tan
and K. Ikeuchi, IEEE TPAMI 27(2), 178-193 (2005), doi:10.1109/TPAMI.2005.36. SF2: K.-J. Yoon, Y.
Choi and I. S. Kweon, ICIP 2006, doi:10.1109/ICIP.2006.312650. Groups: M. Yuan and Y. Lin, J. R.
Statist. Soc. B 68(1), 49-67 (2006), doi:10.1111/j.1467-9868.2005.00532.x.

Limits: the light must be white. Near-grey reflectance keeps its highlights. A broad highlight over
most of a reflectance shifts R_k and stays.
"""

# mypy: disable-error-code="no-untyped-def"

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..filters.components import root
from ..filters.correlation import correlated
from ..filters.gaussian import gaussian_taps
from ..imaging.smoothing import masked_gaussian
from ..numerics.jit import jit
from ..progress import Monitor
from ..scene.decomposition import Separation
from .support.checks import check_arrays, require_colour
from .support.layers import diffuse_layers, white_layers

# Linear Rec.709 to CIE XYZ, and white specular light (1, 1, 1) there: its length and direction (the
# highlight atom).
_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
_WHITE = float(np.linalg.norm(_XYZ.sum(axis=1)))
_HIGHLIGHT = _XYZ.sum(axis=1) / _WHITE
_TINY = 1e-12
_BLURS = 0.01, 1000.0  # pixels: less changes nothing, more has a window larger than a photo
# Basis of the plane orthogonal to the highlight atom, which contains the specular-free images.
_FIRST = np.cross(_HIGHLIGHT, [0.0, 0.0, 1.0]) / np.linalg.norm(
    np.cross(_HIGHLIGHT, [0.0, 0.0, 1.0])
)
_ORTHOGONAL = np.stack([_FIRST, np.cross(_HIGHLIGHT, _FIRST)])
# The histogram of log(t / alpha): its range holds every colour from pure blue to grey within
# rounding.
_LOG_RATIOS = np.linspace(-1, 5, 241)
_LOWER = 0.16  # the quantile one standard deviation below the median


@dataclass(frozen=True)
class SparseCodingOptions:
    """Options of sparse coding.

    Attributes
    ----------
    specular_free : str
        The specular-free images whose edges separate the groups: those of "sf1" (hue), "sf2"
        (magnitude) or "both".
    hues : int
        Number of atoms, equal angles of hue; >= 3.
    ratio_quantile : float
        Which quantile of t / alpha is R_k, in (0, 1).
    grouped : bool
        Whether groups of pixels switch the highlight atom on together, or every pixel for itself by
        an L1 penalty.
    sparsity : float
        lambda; the least share of its brightness that a pixel of a group has as highlight, or, not
        grouped, the L1 weight as a share of the brightest pixels; in [0, 1).
    edge : float
        Least change, as a share of the highlight, that counts as an edge; in (0, 1).
    noise : float
        Changes below this share of the brightest pixels are no edges; in [0, 1).
    blur : float
        Standard deviation, in pixels, of the smoothing before codes are made; 0, or .01 to 1000.
    """

    specular_free: str = "both"
    hues: int = 72
    ratio_quantile: float = 0.5
    grouped: bool = True
    sparsity: float = 0.02
    edge: float = 0.3
    noise: float = 0.01
    blur: float = 0.6


VARIANTS: dict[str, SparseCodingOptions] = {
    "improved": SparseCodingOptions(),
    "paper": SparseCodingOptions(hues=36, grouped=False, sparsity=0.01, blur=0),
}


@dataclass(frozen=True, eq=False)
class _Invariants:
    """Highlight-invariant coordinates: `alpha` (H, W), the length of a pixel's component
    orthogonal to h, `hue` (H, W), its angle in turns, [0, 1). What highlights raise:
    `brightness` (H, W), t, the component along h. Zero outside `mask`.
    """

    alpha: np.ndarray
    hue: np.ndarray
    brightness: np.ndarray
    mask: np.ndarray


@dataclass(frozen=True, eq=False)
class _Dictionary:
    """Tables by hue (k,).

    `log_ratio`: log R_k; `spread`: scatter of the diffuse log ratios around it.
    """

    log_ratio: np.ndarray
    spread: np.ndarray

    def at(self, table: np.ndarray, hue: np.ndarray) -> np.ndarray:
        """A table (k,) read at `hue` (...) in turns, linear between the hues' centres."""
        place = hue * len(table) - 0.5
        below = np.floor(place).astype(int)
        share = place - below
        return table[below % len(table)] * (1 - share) + table[(below + 1) % len(table)] * share


@dataclass(frozen=True, eq=False)
class Stages:
    """Intermediate maps of the grouped code, (H, W) each, 0 outside the mask.

    Attributes
    ----------
    hue : ndarray
        In turns; invariant to highlights.
    alpha : ndarray
        Invariant to highlights.
    brightness : ndarray
        t, the part along the highlight atom.
    beta : ndarray
        Excess of `brightness` over the diffuse atom, for each pixel by itself.
    group : ndarray
        Number of the group that switches the highlight atom on, -1 for none.
    code : ndarray
        `beta` times the kept share of its group.
    """

    hue: np.ndarray
    alpha: np.ndarray
    brightness: np.ndarray
    beta: np.ndarray
    group: np.ndarray
    code: np.ndarray

    @property
    def specular(self) -> np.ndarray:
        """The specular light (H, W), equal in all channels, in the image's unit."""
        return self.code / _WHITE


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: SparseCodingOptions | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure.
    mask : (H, W) bool ndarray
    options : SparseCodingOptions, optional
        By default the improved variant.
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one: they shape no statistic.
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
    options = options or VARIANTS["improved"]
    monitor = monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check_options(options)
    require_colour(image, mask, "sparse_coding")
    image = np.where(mask[..., None], image, 0.0)
    monitor.report("specular-free images", 0.0)
    free = _specular_free(image, mask, options.blur)
    monitor.report("dictionary", 0.3)
    informative = mask if clipped is None or not (mask & ~clipped).any() else mask & ~clipped
    dictionary = _learn(free, informative, options)
    monitor.report("sparse codes", 0.4)
    if options.grouped:
        return white_layers(image, mask, _grouped(free, dictionary, options).specular, clipped)
    return diffuse_layers(
        image, mask, _diffuse_of_pixels(image, free, dictionary, options), clipped
    )


def grouped_specular(image: np.ndarray, mask: np.ndarray, informative: np.ndarray) -> np.ndarray:
    """Return the specular light of the improved variant, before it is clamped.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        0 outside the mask.
    mask : (H, W) bool ndarray
    informative : (H, W) bool ndarray
        Pixels of the mask that shape the atoms.

    Returns
    -------
    (H, W) ndarray
        Equal in all channels.
    """
    return stages(image, mask, informative).specular


def stages(image: np.ndarray, mask: np.ndarray, informative: np.ndarray) -> Stages:
    """Return the intermediate maps of the improved variant.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        0 outside the mask.
    mask : (H, W) bool ndarray
    informative : (H, W) bool ndarray
        Pixels of the mask that shape the atoms.

    Returns
    -------
    Stages
    """
    options = VARIANTS["improved"]
    free = _specular_free(image, mask, options.blur)
    return _grouped(free, _learn(free, informative, options), options)


def _check_options(options: SparseCodingOptions) -> None:
    if options.specular_free not in ("sf1", "sf2", "both"):
        raise InputError(
            f'specular_free must be "sf1", "sf2" or "both", not {options.specular_free!r}'
        )
    if (
        options.hues < 3
        or not 0 < options.ratio_quantile < 1
        or not 0 < options.edge < 1
        or not (options.blur == 0 or _BLURS[0] <= options.blur <= _BLURS[1])
    ):
        raise InputError(
            "hues must be at least 3, ratio_quantile and edge within (0, 1), blur 0 or within "
            f"[{_BLURS[0]:g}, {_BLURS[1]:g}]"
        )
    if not all(0 <= share < 1 for share in (options.sparsity, options.noise)):
        raise InputError("sparsity and noise must be within [0, 1)")


def _specular_free(image: np.ndarray, mask: np.ndarray, blur: float) -> _Invariants:
    pixel = np.where(mask[..., None], masked_gaussian(image, mask, blur), 0) @ _XYZ.T
    one, two = pixel @ _ORTHOGONAL[0], pixel @ _ORTHOGONAL[1]
    return _Invariants(
        np.hypot(one, two), np.arctan2(two, one) / (2 * np.pi) % 1, pixel @ _HIGHLIGHT, mask
    )


def _learn(free: _Invariants, informative: np.ndarray, options: SparseCodingOptions) -> _Dictionary:
    """The atoms from the `informative` pixels (H, W) bool: quantiles of log(t / alpha) per hue,
    weighted by alpha.
    """
    k = np.minimum((free.hue[informative] * options.hues).astype(int), options.hues - 1)
    ratio = np.log(
        np.maximum(free.brightness[informative], _TINY) / np.maximum(free.alpha[informative], _TINY)
    )
    size = len(_LOG_RATIOS)
    place = np.clip(
        (ratio - _LOG_RATIOS[0]) / (_LOG_RATIOS[1] - _LOG_RATIOS[0]), 0, size - 1
    ).astype(int)
    votes = np.bincount(k * size + place, free.alpha[informative], options.hues * size).reshape(
        options.hues, size
    )
    half = gaussian_taps(1.0)
    taps = np.concatenate([half[:0:-1], half])
    summed = np.cumsum(correlated(votes, taps, axis=0, periodic=True), axis=1)

    def quantile(q: float) -> np.ndarray:
        return np.array([np.interp(q * row[-1], row, _LOG_RATIOS) for row in summed])

    middle = quantile(options.ratio_quantile)
    return _Dictionary(middle, np.maximum(middle - quantile(_LOWER), 0.02))


def _diffuse_of_pixels(
    image: np.ndarray, free: _Invariants, dictionary: _Dictionary, options: SparseCodingOptions
) -> np.ndarray:
    """Diffuse (H, W, 3), linear RGB: each pixel coded alone, 1/2 |y - a x - h z|^2 + l (x + z),
    x, z >= 0, with its hue's atom.

    With unit atoms of inner product c the optimum with both active is x = (p - c q) / (1 - c^2), z
    = (q - c p) / (1 - c^2), where p = a.y - l and q = h.y - l; if one is negative, the other alone
    is its p or q.
    """
    k = np.minimum((free.hue * options.hues).astype(int), options.hues - 1)
    atom = _atoms((np.arange(options.hues) + 0.5) / options.hues, dictionary.log_ratio)[k]
    pixel = image @ _XYZ.T
    weight = options.sparsity * float(np.quantile(free.brightness[free.mask], 0.99))
    p, q, c = (atom * pixel).sum(axis=2) - weight, pixel @ _HIGHLIGHT - weight, atom @ _HIGHLIGHT
    apart = np.maximum(1 - c * c, _TINY)
    x = np.where(q - c * p <= 0, p, np.where(p - c * q <= 0, 0, (p - c * q) / apart))
    return (np.maximum(x, 0)[..., None] * atom) @ np.linalg.inv(_XYZ).T


def _atoms(hue: np.ndarray, log_ratio: np.ndarray) -> np.ndarray:
    """Unit colours (..., 3) in XYZ of `hue` (...) in turns; their component along h is R times
    the orthogonal one.
    """
    angle = 2 * np.pi * hue[..., None]
    colour = (
        np.cos(angle) * _ORTHOGONAL[0]
        + np.sin(angle) * _ORTHOGONAL[1]
        + np.exp(log_ratio)[..., None] * _HIGHLIGHT
    )
    return colour / np.linalg.norm(colour, axis=-1, keepdims=True)


def _grouped(free: _Invariants, dictionary: _Dictionary, options: SparseCodingOptions) -> Stages:
    """The code of the highlight atom, activated in groups of pixels."""
    log_ratio = dictionary.at(dictionary.log_ratio, free.hue)
    diffuse = np.exp(log_ratio) * free.alpha
    beta = np.where(free.mask, np.maximum(free.brightness - diffuse, 0), 0)
    brightest = float(np.quantile(free.brightness[free.mask], 0.99))
    floor = options.noise * brightest
    active = beta > options.sparsity * free.brightness + floor / 2
    code, group = np.zeros(beta.shape), np.full(beta.shape, -1, np.int64)
    result = Stages(free.hue, free.alpha, free.brightness, beta, group, code)
    if not active.any():
        return result
    angle = 2 * np.pi * free.hue
    colour = np.stack([np.cos(angle), np.sin(angle), free.alpha, np.exp(log_ratio), beta], axis=2)
    considered = options.specular_free != "sf2", options.specular_free != "sf1"
    parent = np.arange(active.size, dtype=np.int64)
    _groups(colour, active, considered, options.edge, floor, parent)
    roots, number = np.unique(parent.reshape(active.shape)[active], return_inverse=True)
    group[active] = number
    statistics = np.zeros((5, len(roots)))
    _group_statistics(colour, group, free.mask, considered, options.edge, floor, statistics)
    excess = np.log(free.brightness[active] / np.maximum(diffuse[active], _TINY))
    cues = _PixelCues(
        saturation=_saturation(free.hue[active], log_ratio[active]),
        spread=dictionary.at(dictionary.spread, free.hue[active]),
        excess=excess,
    )
    code[active] = (
        _group_gains(number, beta[active], cues, statistics, brightest)[number] * beta[active]
    )
    return result


@dataclass(frozen=True, eq=False)
class _PixelCues:
    """Cues of each active pixel (n,): `saturation`, 1 - smallest / largest channel, of its atom;
    `spread`, the scatter of the atom's pixels, and `excess` above the atom, both as logarithms of
    ratios.
    """

    saturation: np.ndarray
    spread: np.ndarray
    excess: np.ndarray


def _saturation(hue: np.ndarray, log_ratio: np.ndarray) -> np.ndarray:
    colour = _atoms(hue, log_ratio) @ np.linalg.inv(_XYZ).T
    return 1 - colour.min(axis=-1) / np.maximum(colour.max(axis=-1), _TINY)


def _group_gains(
    group: np.ndarray, beta: np.ndarray, cues: _PixelCues, statistics: np.ndarray, brightest: float
) -> np.ndarray:
    """The gain of each group's code, in [0, 1]: the product of six ramps over averages weighted by
    beta.

    `group`, `beta` (n,) of the active pixels; `statistics` (5, groups) as in `_group_statistics`;
    `brightest`: of the object's t. The ramps test, in order: whether the reflectance is saturated,
    hence distinct from white; whether the atom's other pixels share one reflectance; whether the
    group exceeds them; whether it is as bright as the image of a light source; whether its
    brightness changes where the specular-free images do not; and whether it fades at its border,
    as specular light does and reflectance does not.
    """
    total = np.maximum(np.bincount(group, beta), _TINY)

    def mean(value: np.ndarray) -> np.ndarray:
        return np.bincount(group, value * beta) / total

    specular_score, reflectance_score, step, border, peak = statistics
    return (
        _ramp(mean(cues.saturation), 0.42, 0.52)
        * _ramp(-mean(cues.spread), -0.35, -0.25)
        * _ramp(mean(cues.excess / cues.spread), 1.5, 2.5)
        * _ramp(mean(beta) / brightest, 0.08, 0.18)
        * _ramp(specular_score / np.maximum(specular_score + reflectance_score, _TINY), 0.5, 0.6)
        * _ramp(-step / np.maximum(border * peak, _TINY), -0.12, -0.08)
    )


def _ramp(value: np.ndarray, none: float, full: float) -> np.ndarray:
    return np.clip((value - none) / (full - none), 0, 1)


@jit
def _change(colour, considered, y, x, v, u):
    """Between two pixels: the change of the specular-free images in units of beta, the step of
    beta, and the larger beta.

    `colour` (H, W, 5): cosine and sine of the hue, alpha, R, beta. |F - F'|^2 = (alpha - alpha')^2
    + alpha alpha' |u - u'|^2 for unit vectors u of the hue: the second part belongs to SF1, the
    first to SF2; `considered` selects them.
    """
    one, two = colour[y, x], colour[v, u]
    square = 0.0
    if considered[0]:
        square += one[2] * two[2] * ((one[0] - two[0]) ** 2 + (one[1] - two[1]) ** 2)
    if considered[1]:
        square += (one[2] - two[2]) ** 2
    return min(one[3], two[3]) * np.sqrt(square), abs(one[4] - two[4]), max(one[4], two[4])


@jit(types="f8[3] b1[2] (b1 b1) f8 f8 i8[1]")
def _groups(colour, active, considered, edge, floor, parent):
    """Point each pixel, row * W + column, at the first one of its connected region; edges and
    inactive pixels separate regions. `parent` (H W,) points each pixel at itself before.
    """
    height, width = active.shape
    for y in range(height):
        for x in range(width):
            for v, u in ((y, x + 1), (y + 1, x)):
                if v < height and u < width and active[y, x] and active[v, u]:
                    change, _, peak = _change(colour, considered, y, x, v, u)
                    if change <= max(edge * peak, floor):
                        one, two = root(parent, y * width + x), root(parent, v * width + u)
                        parent[max(one, two)] = min(one, two)
    for pixel in range(height * width):
        parent[pixel] = root(parent, pixel)


@jit(types="f8[3] i8[2] b1[2:] (b1 b1) f8 f8 f8[2]")
def _group_statistics(colour, group, mask, considered, edge, floor, sums):
    """Add to sums (5, groups) over the neighbours of each group: changes of beta attributed to
    specular light and to reflectance, steps of beta at the border, the number of border neighbours,
    and the largest beta. `group` (H, W) is -1 where not active.
    """
    height, width = mask.shape
    for y in range(height):
        for x in range(width):
            if group[y, x] >= 0:
                sums[4, group[y, x]] = max(sums[4, group[y, x]], colour[y, x, 4])
            for v, u in ((y, x + 1), (y + 1, x)):
                if (
                    v == height
                    or u == width
                    or not mask[y, x]
                    or not mask[v, u]
                    or max(group[y, x], group[v, u]) < 0
                ):
                    continue
                change, step, peak = _change(colour, considered, y, x, v, u)
                light = step if change < edge * step else 0.0
                if change > max(edge * peak, floor) and step < edge * peak:
                    light += peak
                reflectance = step if change >= edge * step and step >= edge * peak else 0.0
                for one, two in ((group[y, x], group[v, u]), (group[v, u], group[y, x])):
                    if one >= 0:
                        sums[0, one] += light
                        sums[1, one] += reflectance
                        if one != two:
                            sums[2, one] += step
                            sums[3, one] += 1
