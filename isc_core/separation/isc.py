"""The separator of this project: it removes only highlights that a photo proves to be highlights.

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). By colour alone pale
reflectance passes for a highlight; the harm then far exceeds what all highlights are worth. So a
candidate s is found by colour, and then has to pass tests.

Equation: with C = max I - min I, which white light leaves unchanged, and the diffuse ratio q = min
D / (max D - min D) of the reflectance,

    s = min I - q C.

q is estimated twice. By hue: a low quantile of min I / max I over nearby pixels of similar hue
(`hue_grid`), which finds highlights that cover whole patches of one reflectance. By place: the mode
over pixels that can be reached without crossing a reflectance edge (`edge_aware`), which
distinguishes reflectances of one hue. The first is used for saturated objects only, the second
wherever its candidate exceeds the scatter of its own region. Both must not run against C as white
reflectance does (`highlight_cues`), and must be smooth, or, by place, be found by the groups of
`sparse_coding` as well. Beside reflectance edges, where mixed pixels look like highlights, s is
interpolated from around. The layer is the larger of the two.

All statistics are of the mask's pixels. Objects longer than 640 pixels are analysed on averages of
square blocks: the tables of q and the gains are upsampled, s itself is computed from the full
photo. Where nothing is proven the pixel stays unchanged, and so does a photo whose whole layer no
display would show.

`prior` is the interface for shape and light: the probability of a visible highlight at each pixel.
It multiplies the odds of the gain there: 0.5 is neutral, 0 forbids a highlight, 1 accepts all of a
candidate that has any gain. What colour rejects stays rejected.

Citation: the cues and their combination are ours; the diffuse ratio is that of H.-L. Shen and Z.-H.
Zheng (2013), doi:10.1364/AO.52.004483. See also the modules named above.

Limits: the light must be white. Near-grey reflectance keeps its highlights, because its q is
unknown; so does a photo without colour, and so do objects with a fine pattern all over. Pale
reflectance that fades in smoothly on a coloured object passes for a highlight.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from ..errors import InputError
from ..imaging.channels import largest, smallest
from ..imaging.smoothing import masked_gaussian, weighted_gaussian
from ..imaging.upsampling import enlarged
from ..progress import Monitor
from ..scene.decomposition import Separation
from .sparse_coding import grouped_specular
from .support.checks import check_arrays
from .support.edge_aware import Paths
from .support.filter_statistics import highlight_prior
from .support.highlight_cues import (
    Steps,
    far_from_borders,
    noise_level,
    paint_mixing,
    ramp,
    roughness,
    steps_of,
)
from .support.hue_grid import HueGrid, Places, hue_of, quantile
from .support.layers import white_layers
from .support.saturation_gate import saturation_gate

# Objects longer than this are judged on averages of blocks, in pixels.
_LONGEST = 640
_BINS, _CHROMA_BINS = 100, 64
_TINY = np.float32(1e-9)
# A layer that is nowhere brighter is none, as a share of the brightest value: half a step of a
# display of eight bits.
_FAINTEST = 1 / 512
# Gaussian smoothing, in pixels, before the ratios by hue and by place are taken.
_BY_HUE, _BY_PLACE = 0.7, 1.0
# A step of log C, and of the hue's shares, that counts as a border; the share of the brightest
# value below which C is noise.
_CHROMA_STEP, _SHARE_STEP, _DARK = 0.5, 0.1, 0.03
# Of the filter by place: its reach as a share of the object's diagonal, the scale of doubt, rounds;
# and how many times the smallest step.
_REACH, _DOUBT, _ROUNDS, _SMALLEST_STEP = 0.15, 0.1, 4, 0.01
# How far around what is proven a highlight may fade out, as a share of the object's diagonal.
_NEARBY = 0.02


@dataclass(frozen=True)
class IscOptions:
    """Options of the separator.

    Ramps are pairs: 0 up to the first number, 1 from the second on (descending ones reversed).

    Attributes
    ----------
    hues : int
        Cells around the circle of hues, >= 6.
    cell : float
        Side of the grid's cells as a share of the object's longer side, in (0, 1].
    low_quantile : float
        Which quantile of min / max over like pixels is the paint's, in (0, 1); lower removes more.
    borrowed : float
        Votes of the pixels of similar hue everywhere in a cell; >= 0.
    colourful : tuple[float, float]
        Ramp of the bright pixels' saturation, sum C / sum max I.
    smooth : tuple[float, float]
        Ramp of the roughness of the whole candidate, descending.
    smooth_here : tuple[float, float]
        Ramp of the local roughness, descending.
    unmixed : tuple[float, float]
        Ramp of the reflectance mixing of the whole candidate, falling.
    bright : tuple[float, float]
        Ramp of min I over its mean.
    clear : tuple[float, float]
        Ramp of s over `scatter` times the remainder, by hue.
    scatter : float
        See `clear`.
    scatter_here : float
        Least relative scatter of q by place.
    coloured : tuple[float, float]
        Ramp of 1 - min / max of the reflectance, by place.
    present : tuple[float, float]
        Ramp of C over that of similar pixels.
    unmixed_here, smooth_by_place : tuple[float, float]
        As above, by place.
    proven : tuple[float, float]
        Ramp of the gain around which `faint` applies.
    faint : tuple[float, float]
        Ramp of s over its error, near proven highlights.
    filters : bool
        Whether to use the filter statistics too, see `filter_statistics`: fewer false highlights,
        fewer true ones.
    """

    hues: int = 48
    cell: float = 0.08
    low_quantile: float = 0.25
    borrowed: float = 100.0
    colourful: tuple[float, float] = (0.43, 0.51)
    smooth: tuple[float, float] = (0.43, 0.35)
    smooth_here: tuple[float, float] = (0.8, 0.5)
    unmixed: tuple[float, float] = (0.55, 0.3)
    bright: tuple[float, float] = (1.0, 1.6)
    clear: tuple[float, float] = (0.3, 0.85)
    scatter: float = 0.035
    scatter_here: float = 0.1
    coloured: tuple[float, float] = (0.35, 0.5)
    present: tuple[float, float] = (0.62, 1.05)
    unmixed_here: tuple[float, float] = (0.3, 0.05)
    smooth_by_place: tuple[float, float] = (0.8, 0.5)
    proven: tuple[float, float] = (0.5, 0.95)
    faint: tuple[float, float] = (0.2, 1.0)
    filters: bool = False


VARIANTS: dict[str, IscOptions] = {"improved": IscOptions()}


@dataclass(frozen=True)
class _Photo:
    """The object at one scale: `image` (H, W, 3), `mask` and `usable` (not clipped) (H, W) bool;
    smoothed for the ratios by hue: `low`, `high`, their difference `chroma` and the `hue` (H, W).
    `peak`: the brightest value; `base`: the mean of `low`; `noise`: its standard deviation, which
    nobody asks of a full photo that was judged on averages.
    """

    image: np.ndarray
    mask: np.ndarray
    usable: np.ndarray
    low: np.ndarray
    high: np.ndarray
    hue: np.ndarray

    @cached_property
    def peak(self) -> float:
        return max(float(np.quantile(self.image[self.mask], 0.999)), float(_TINY))

    @cached_property
    def base(self) -> float:
        return max(float(self.low[self.mask].mean(dtype=float)), float(_TINY) * self.peak)

    @cached_property
    def noise(self) -> float:
        return noise_level(self.image, self.mask)

    @cached_property
    def chroma(self) -> np.ndarray:
        return self.high - self.low

    @property
    def diagonal(self) -> float:
        rows, columns = self.mask.shape
        return float(np.hypot(rows, columns))


@dataclass(frozen=True)
class _Paints:
    """What the pixels of like hue say: `share` of the smallest in the largest channel of their
    paint, and their `chroma`, as tables of the `grid`, in units of 1 and of the photo's peak.
    `places`: those of the pixels that they were learned from.
    """

    grid: HueGrid
    places: Places
    share: np.ndarray
    chroma: np.ndarray


@dataclass(frozen=True)
class _Judged:
    """Candidates for s, by hue and by place, and their gains in [0, 1];

    `share` (H, W): the paint's min / max by place.
    """

    by_hue: np.ndarray
    gain_by_hue: np.ndarray
    by_place: np.ndarray
    gain_by_place: np.ndarray
    share: np.ndarray


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: IscOptions | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
    prior: np.ndarray | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure.
    mask : (H, W) bool ndarray
        Pixels outside have no influence.
    options : IscOptions, optional
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one: they shape no statistic.
    monitor : Monitor, optional
    prior : (H, W) ndarray, optional
        Probability of a visible highlight, in [0, 1]; 0.5 where unknown.

    Returns
    -------
    Separation
        Inside the mask 0 <= diffuse <= image. The confidence falls with the expected error. A photo
        without colour is left unchanged, with low confidence.

    Raises
    ------
    InputError
        If shapes or options are invalid, the mask is empty, or values inside it are negative or not
        finite.
    Cancelled
        If the user asked to stop.
    """
    options, monitor = options or VARIANTS["improved"], monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check(options, prior, mask)
    if options.filters:
        found = highlight_prior(image, mask)
        prior = found if prior is None else _at_odds(found, prior)
    unit = _unit(image[mask])
    image = (np.where(mask[..., None], image, 0) / unit).astype(np.float32)
    usable = mask if clipped is None else mask & ~clipped
    factor = -(-max(mask.shape) // _LONGEST)
    monitor.report("looking at the paints", 0.0)
    photo = _photo(*_blocks(image, mask, usable, factor))
    paints = _paints(photo, options)
    monitor.report("weighing the evidence", 0.3)
    judged = _judge(photo, paints, options)
    monitor.report("taking highlights off", 0.8)
    if factor > 1:
        photo = _photo(image, mask, usable)
        judged = _carried_over(photo, paints, judged, factor)
    specular = np.maximum(
        judged.by_hue * _at_odds(judged.gain_by_hue, prior),
        judged.by_place * _at_odds(judged.gain_by_place, prior),
    )
    if float(specular.max()) < _FAINTEST * photo.peak:
        specular = np.zeros_like(specular)
    forbidden = np.zeros(mask.shape, bool) if prior is None else prior == 0
    split = white_layers(image, mask, specular, None if clipped is None else clipped & ~forbidden)
    trusted = np.ones(mask.shape, bool) if clipped is None else ~clipped
    confidence = np.where(trusted, _confidence(photo, split.specular[..., 0]), 0)
    return Separation(
        unit * split.diffuse, unit * split.specular, unit * split.residual, confidence
    )


def _unit(values: np.ndarray) -> np.float32:
    """A power of two near the largest value: dividing by it rounds nothing, and the small constants
    mean the same at any exposure.
    """
    return np.float32(2.0 ** np.ceil(np.log2(max(float(values.max()), 1e-30))))


def _check(options: IscOptions, prior: np.ndarray | None, mask: np.ndarray) -> None:
    if (
        options.hues < 6
        or not 0 < options.cell <= 1
        or not 0 < options.low_quantile < 1
        or not 0 <= options.borrowed < np.inf
    ):
        raise InputError(
            "hues must be at least 6, cell within (0, 1], low_quantile within (0, 1), borrowed at "
            "least 0"
        )
    if not (0 <= options.scatter < np.inf and 0 <= options.scatter_here < np.inf):
        raise InputError("scatter and scatter_here must be numbers from 0 on")
    for name, ends in vars(options).items():
        if isinstance(ends, tuple) and (
            len(ends) != 2 or not np.isfinite(ends).all() or ends[0] == ends[1]
        ):
            raise InputError(f"{name} must be two different numbers, the ends of a ramp")
    if prior is None:
        return
    if prior.shape != mask.shape:
        raise InputError(f"the prior must have the photo's size {mask.shape}, not {prior.shape}")
    if not np.isfinite(prior[mask]).all() or prior[mask].min() < 0 or prior[mask].max() > 1:
        raise InputError("the prior must lie within [0, 1] inside the mask: it is a probability")


def _blocks(
    image: np.ndarray, mask: np.ndarray, usable: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The three at 1 / `factor` of their size: averages of the mask's pixels in each block; a block
    is usable if all of those are.
    """
    if factor == 1:
        return image, mask, usable
    padded = [(0, -n % factor) for n in mask.shape]
    rows, columns = (
        (n + extra) // factor for n, (_, extra) in zip(mask.shape, padded, strict=True)
    )
    shape = rows, factor, columns, factor

    def share(values: np.ndarray) -> np.ndarray:
        return np.pad(values, padded).reshape(shape).mean(axis=(1, 3), dtype=np.float32)

    covered = share(mask)
    inside = covered > 0.5
    whole = (
        np.stack([share(image[..., c]) for c in range(3)], axis=2)
        / np.maximum(covered, _TINY)[..., None]
    )
    if not inside.any():
        inside = covered > 0
    return np.where(inside[..., None], whole, 0), inside, inside & (share(mask & ~usable) == 0)


def _photo(image: np.ndarray, mask: np.ndarray, usable: np.ndarray) -> _Photo:
    smooth = np.where(mask[..., None], masked_gaussian(image, mask, _BY_HUE), 0)
    low, high = smallest(smooth), largest(smooth)
    return _Photo(image, mask, usable, low, high, hue_of(smooth, low, high))


def _paints(photo: _Photo, options: IscOptions) -> _Paints:
    """The tables of `_Paints`, from bright and coloured pixels; chroma from those that show little
    candidate highlight.
    """
    mask, low, high, chroma = photo.mask, photo.low, photo.high, photo.chroma
    grid = HueGrid(
        (mask.shape[0], mask.shape[1]), max(options.cell * max(mask.shape), 1.0), options.hues
    )
    places = _places(grid, photo, 1)
    telling = (photo.usable & (low > photo.base) & (chroma > photo.base / 2))[mask].astype(
        np.float32
    )
    bins = np.minimum(
        (_BINS * low[mask] / np.maximum(high[mask], _TINY)).astype(np.int64), _BINS - 1
    )
    near, everywhere = grid.histograms(places, bins, _BINS, telling)
    everywhere /= everywhere.sum(axis=-1, keepdims=True)
    near += options.borrowed * everywhere
    share = quantile(near, options.low_quantile)
    found = _specular(low[mask], chroma[mask], places.read(share))
    telling *= np.exp(-np.square(found / np.maximum(0.1 * high[mask], _TINY)))
    bins = np.minimum(
        (np.clip(chroma[mask] / photo.peak, 0, 1) * (_CHROMA_BINS - 0.01)).astype(np.int64),
        _CHROMA_BINS - 1,
    )
    near, everywhere = grid.histograms(places, bins, _CHROMA_BINS, telling)
    everywhere /= everywhere.sum(axis=-1, keepdims=True)
    near += 20 * everywhere
    return _Paints(grid, places, share, quantile(near, 0.5))


def _places(grid: HueGrid, photo: _Photo, scale: float) -> Places:
    """Of the mask's pixels;

    `scale`: how many of them to a pixel of the photo that the grid is of.
    """
    rows, columns = np.nonzero(photo.mask)
    return grid.places(
        (rows + 0.5) / scale - 0.5, (columns + 0.5) / scale - 0.5, photo.hue[photo.mask]
    )


def _specular(low: np.ndarray, chroma: np.ndarray, share: np.ndarray) -> np.ndarray:
    """s = min I - q C, within [0, min I], for a paint whose smallest channel is `share` of its
    largest.
    """
    return np.clip(low - _ratio(share) * chroma, 0, low)


def _ratio(share: np.ndarray) -> np.ndarray:
    return share / np.maximum(1 - share, np.float32(0.01))


def _spread(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """`values` (n,) of the mask's pixels as a map (H, W), 0 elsewhere."""
    layer = np.zeros(mask.shape, np.float32)
    layer[mask] = values
    return layer


def _judge(photo: _Photo, paints: _Paints, options: IscOptions) -> _Judged:
    """Both candidates and what the evidence leaves of them."""
    hue_share, usual_chroma = (
        _spread(paints.places.read(table), photo.mask)
        for table in (paints.share, photo.peak * paints.chroma)
    )
    by_hue = _specular(photo.low, photo.chroma, hue_share)
    trust = far_from_borders(_chroma_steps(photo), photo.mask, blur=1.5, unit=0.6)
    with ThreadPoolExecutor(
        1
    ) as beside:  # filters release the interpreter's lock, and neither needs what the other finds
        in_groups = beside.submit(
            grouped_specular,
            photo.image,
            photo.mask,
            photo.usable if photo.usable.any() else photo.mask,
        )
        gain_by_hue = beside.submit(_gain_by_hue, photo, by_hue, hue_share, trust, options)
        by_place, gain_by_place, share = _by_place(photo, usual_chroma, trust, in_groups, options)
        return _Judged(by_hue, gain_by_hue.result(), by_place, gain_by_place, share)


def _chroma_steps(photo: _Photo) -> Steps:
    level = photo.chroma + _DARK * photo.peak
    # Three standard deviations of the difference of two neighbours, whose noise the smoothing has
    # brought down to a third.
    floor = 3 * 0.3 * 1.4 * photo.noise / level / _CHROMA_STEP
    return steps_of([(np.log(level), _CHROMA_STEP)], photo.mask, floor)


def _gain_by_hue(
    photo: _Photo, candidate: np.ndarray, share: np.ndarray, trust: np.ndarray, options: IscOptions
) -> np.ndarray:
    """The share (H, W) of the candidate by hue that is kept: whether it is believed at all is
    decided for the object as a whole.
    """
    mask, low = photo.mask, photo.low
    bright = ramp(low / photo.base, options.bright)
    found = candidate * bright
    weight = np.where(mask, ramp(low / photo.base, (0.5, 1.2)), 0)
    colour = (photo.chroma * weight).sum(dtype=float) / max(
        (photo.high * weight).sum(dtype=float), float(_TINY)
    )
    scale = max(0.015 * photo.diagonal, 2.5)
    rough, rough_here = roughness(found, trust, mask, scale, fine=1.5)
    believed = float(ramp(colour, options.colourful) * ramp(rough, options.smooth))
    if believed > 0:
        believed *= float(ramp(_mixing(photo, found, share, trust), options.unmixed))
    if believed == 0:
        return np.zeros(mask.shape, np.float32)
    clear = ramp(found / (options.scatter * (low - found) + _TINY), options.clear)
    kept = _carried_in(found * ramp(rough_here, options.smooth_here) * clear, trust)
    return np.where(mask, believed * kept / np.maximum(candidate, _TINY), 0)


def _mixing(photo: _Photo, found: np.ndarray, share: np.ndarray, trust: np.ndarray) -> float:
    """The median paint mixing where the candidate `found` (H, W) is strong."""
    inside = np.where(photo.mask, found, 0)
    smooth = _carried_in(inside, np.square(trust), reach=4.0)
    mixing = paint_mixing(
        smooth, photo.chroma, _ratio(share), photo.usable, max(0.03 * photo.diagonal, 2.5)
    )
    values = inside[photo.mask]
    return float(np.median(mixing[photo.mask][values >= 0.3 * np.quantile(values, 0.99)]))


def _carried_in(found: np.ndarray, trust: np.ndarray, reach: float = 2.5) -> np.ndarray:
    """`found` (H, W) where it can be trusted, and beside borders no more than around them, within
    `reach` pixels.
    """
    around = weighted_gaussian(found, trust, reach, 1e-3)
    return trust * found + (1 - trust) * np.minimum(around, found)


def _by_place(
    photo: _Photo,
    usual_chroma: np.ndarray,
    trust: np.ndarray,
    in_groups: "Future[np.ndarray]",
    options: IscOptions,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The candidate by place, its gain and the paint's min / max, all (H, W);

    `in_groups`: what `grouped_specular` is to find.
    """
    mask = photo.mask
    smooth = np.where(mask[..., None], masked_gaussian(photo.image, mask, _BY_PLACE), 0)
    low, high = smallest(smooth), largest(smooth)
    chroma = high - low
    seen = low / np.maximum(high, _TINY)
    paths = _paths(smooth, low, chroma, photo)
    weight = photo.usable.astype(np.float32)
    share = paths.lower_mode(seen, weight, _DOUBT, _ROUNDS)
    ratio, seen_ratio = _ratio(share), _ratio(seen)
    off = np.clip((seen_ratio - ratio) / np.maximum(ratio, np.float32(1e-3)), -1, 1)
    scatter = np.sqrt(paths.weighted(np.square(off), weight * (off <= 0)))
    candidate = np.where(mask, np.clip(low - ratio * chroma, 0, low), 0)
    error = np.hypot(
        np.hypot(scatter, options.scatter_here) * (low - candidate), 3 * photo.noise * (1 + ratio)
    )
    gain = ramp(candidate / np.maximum(error, _TINY), (1.0, 3.0))
    gain *= ramp(photo.chroma / np.maximum(usual_chroma, _TINY), options.present) * ramp(
        photo.low / photo.base, (0.5, 1.2)
    )
    scale = max(0.015 * photo.diagonal, 2.5)
    gain *= ramp(
        paint_mixing(candidate, photo.chroma, ratio, photo.usable, scale), options.unmixed_here
    )
    safe = gain * trust * ramp(1 - share, options.coloured)
    _, rough_here = roughness(candidate * safe, trust, mask, scale, fine=1.5)
    agreed = np.minimum(gain, in_groups.result() / np.maximum(candidate, _TINY))
    proven = np.where(mask, np.maximum(safe * ramp(rough_here, options.smooth_by_place), agreed), 0)
    # A highlight fades out: around what is proven, what would not be enough by itself belongs to
    # it.
    around = ndimage.maximum_filter(
        ramp(proven, options.proven), 2 * round(_NEARBY * photo.diagonal) + 1
    )
    faint = trust * ramp(candidate / np.maximum(error, _TINY), options.faint)
    faint *= ramp(photo.chroma / np.maximum(usual_chroma, _TINY), options.present)
    return candidate, np.where(mask, np.maximum(proven, np.minimum(faint, around)), 0), share


def _paths(smooth: np.ndarray, low: np.ndarray, chroma: np.ndarray, photo: _Photo) -> Paths:
    """Distances that grow across reflectance edges, and are infinite across the silhouette."""
    dark = _DARK * photo.peak
    free = smooth - low[..., None]
    shares = free / (free.sum(axis=2) + np.float32(dark))[..., None]
    reach = _REACH * photo.diagonal
    steps = steps_of(
        [(shares, _SHARE_STEP), (np.log(chroma + dark), _CHROMA_STEP)], photo.mask, _SMALLEST_STEP
    )
    across, down = 1 + reach * steps.across, 1 + reach * steps.down
    across[:, 1:][photo.mask[:, 1:] != photo.mask[:, :-1]] = 1e6
    down[1:][photo.mask[1:] != photo.mask[:-1]] = 1e6
    return Paths(across, down, reach)


def _carried_over(full: _Photo, paints: _Paints, judged: _Judged, factor: int) -> _Judged:
    """What was found on averages of `factor` x `factor` pixels, for the full photo."""
    mask = full.mask
    hue_share = _spread(_places(paints.grid, full, factor).read(paints.share), mask)
    gain_by_hue, gain_by_place, share = (
        enlarged(layer, mask.shape, factor)
        for layer in (judged.gain_by_hue, judged.gain_by_place, judged.share)
    )
    by_hue = _specular(full.low, full.chroma, hue_share)
    by_place = _specular(full.low, full.chroma, share)
    return _Judged(by_hue, gain_by_hue, by_place, gain_by_place, share)


def _at_odds(gain: np.ndarray, prior: np.ndarray | None) -> np.ndarray:
    """The gain after its odds are multiplied by the prior's."""
    if prior is None:
        return gain
    yes, no = gain * prior, (1 - gain) * (1 - prior)
    return yes / np.maximum(yes + no, _TINY)


def _confidence(photo: _Photo, specular: np.ndarray) -> np.ndarray:
    """exp(-e / u) (H, W): e, the error to be expected, is a share of what was removed and of what
    could hide in the smallest channel.

    On a pale object colour tells little, and e is up to three times as large.
    """
    error = (specular + 0.3 * photo.low) * (3 - 2 * saturation_gate(photo.image, photo.mask))
    return np.where(photo.mask, np.exp(-error / photo.base), 0).astype(np.float32)
