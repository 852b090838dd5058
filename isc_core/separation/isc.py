"""The separator of this project: it removes a highlight only where colour shows that it is one, and
its form does not indicate print.

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). By colour alone pale
reflectance is mistaken for a highlight, with larger errors than those of all highlights. So a
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

White print on strong colour passes these tests, too. Therefore colour and the form that the scene
network sees decide about each connected region of s together (`highlight_evidence`): where the odds
of a highlight against print do not exceed `odds`, the photo is restored.

`prior` is the interface for shape and light: the probability of a visible highlight at each pixel.
It multiplies the odds of the gain there: 0.5 is neutral, 0 forbids a highlight, 1 accepts all of a
candidate that has any gain. What colour rejects stays rejected. It multiplies the odds of a region
against print, too.

Citation: the cues and their combination are ours; the diffuse ratio is that of H.-L. Shen and Z.-H.
Zheng (2013), doi:10.1364/AO.52.004483. See also the modules named above.

Limits: the light must be white. Near-grey reflectance keeps its highlights, because its q is
unknown; so does a photo without colour, and so do objects with a fine pattern all over. Pale
reflectance that fades in smoothly on a coloured object passes for a highlight.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import ndimage

from ..errors import InputError
from ..imaging.channels import largest, smallest
from ..imaging.row_blocks import row_blocks
from ..imaging.smoothing import masked_gaussian, weighted_gaussian
from ..imaging.upsampling import enlarged
from ..imaging.window import as_map
from ..networks.scene_network import predict_layers
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..scene.diagnostics import Abstention
from .sparse_coding import grouped_specular
from .support.checks import check_arrays, has_colour
from .support.edge_aware import Paths
from .support.filter_statistics import highlight_prior
from .support.highlight_cues import (
    Steps,
    far_from_borders,
    noise_level,
    ramp,
    reflectance_mixing,
    roughness,
    steps_of,
)
from .support.highlight_evidence import classify_highlights
from .support.hue_grid import HueGrid, Places, hue_of, quantile
from .support.layers import keep_highlights, white_layers
from .support.saturation_gate import saturation_gate

# Longest side in pixels at which statistics are computed; larger objects are block-averaged.
_MAX_SIDE = 640
_BINS, _CHROMA_BINS = 100, 64
_TINY = np.float32(1e-9)
# A layer whose maximum stays below this share of the brightest value is dropped: half a step of an
# 8-bit display.
_MIN_PEAK = 1 / 512
# Gaussian sigmas, in pixels, applied before the ratios by hue and by place are computed.
_BY_HUE, _BY_PLACE = 0.7, 1.0
_SMOOTH_REACH = 3  # pixels, at least, of `_BY_HUE`
# Steps of log C and of the hue's shares that count as an edge; the share of the brightest value
# below which C is noise.
_CHROMA_STEP, _SHARE_STEP, _DARK = 0.5, 0.1, 0.03
# The filter by place: reach as a share of the object's diagonal, scale tau of the robust weights,
# iterations, smallest step.
_REACH, _TAU, _ROUNDS, _MIN_STEP = 0.15, 0.1, 4, 0.01
# Extent of a highlight's faint rim around proven pixels, as a share of the object's diagonal.
_RIM = 0.02


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
        Quantile of min I / max I over pixels of similar hue that is the diffuse ratio, in (0, 1); a
        lower one removes more.
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
    odds : float
        Odds of a highlight against print that a region must exceed, >= 0; 0: colour alone decides.
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
    odds: float = 1.0


VARIANTS: dict[str, IscOptions] = {"improved": IscOptions()}


@dataclass(frozen=True)
class _ObjectMaps:
    """The object at one scale: `image` (H, W, 3), `mask` and `usable` (not clipped) (H, W) bool;
    smoothed for the ratios by hue: `low`, `high`, their difference `chroma` and the `hue` (H, W).
    `peak`: the brightest value; `base`: the mean of `low`; `noise`: its standard deviation,
    computed only on demand.
    """

    image: np.ndarray
    mask: np.ndarray
    usable: np.ndarray
    low: np.ndarray
    high: np.ndarray
    hue: np.ndarray

    @cached_property
    def peak(self) -> float:
        return _peak(self.image, self.mask)

    @cached_property
    def base(self) -> float:
        return _base(self.low, self.mask, self.peak)

    @cached_property
    def noise(self) -> float:
        return noise_level(self.image, self.mask)

    @cached_property
    def chroma(self) -> np.ndarray:
        return self.high - self.low

    def rows(self, rows: slice) -> "_ObjectMaps":
        maps = self.image, self.mask, self.usable, self.low, self.high, self.hue
        return _ObjectMaps(*(one[rows] for one in maps))

    @property
    def diagonal(self) -> float:
        rows, columns = self.mask.shape
        return float(np.hypot(rows, columns))


@dataclass(frozen=True)
class _DiffuseRatios:
    """Diffuse statistics by hue, as tables over the `grid`: `share`, the ratio min D / max D, and
    `chroma` in units of the photo's peak. `places`: grid positions of the pixels they come from.
    """

    grid: HueGrid
    places: Places
    share: np.ndarray
    chroma: np.ndarray


@dataclass(frozen=True)
class _Candidates:
    """Candidates for s by hue and by place, with their gains in [0, 1].

    `share` (H, W): min D / max D by place.
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
        Pixels whose true value lies above the recorded one: statistics ignore them.
    monitor : Monitor, optional
    prior : (H, W) ndarray, optional
        Probability of a visible highlight, in [0, 1]; 0.5 where unknown.

    Returns
    -------
    Separation
        Inside the mask 0 <= diffuse <= image. The confidence falls with the expected error. A photo
        without colour is left unchanged, with low confidence. `abstention` is set where nothing is
        removed from pixels that are not clipped.

    Raises
    ------
    InputError
        If shapes or options are invalid, the mask is empty, or values inside it are negative or not
        finite.
    Cancelled
        If the user cancels.
    """
    options, monitor = options or VARIANTS["improved"], monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check(options, prior, mask)
    if options.filters:
        cue = highlight_prior(image, mask)
        prior = cue if prior is None else _apply_prior(cue, prior)
    unit = _unit(image[mask])
    image = (np.where(mask[..., None], image, 0) / unit).astype(np.float32)
    usable = mask if clipped is None else mask & ~clipped
    factor = -(-max(mask.shape) // _MAX_SIDE)
    monitor.report("estimating diffuse colours", 0.0)
    photo = _object_maps(*_block_averages(image, mask, usable, factor))
    ratios = _diffuse_ratios(photo, options)
    monitor.report("testing highlight candidates", 0.3)
    candidates = _candidates(photo, ratios, options)
    monitor.report("removing highlights", 0.8)
    if factor == 1:
        specular, low = _combined(candidates, prior), photo.low
    else:
        specular, low = _of_full_size(image, mask, ratios, candidates, factor, prior)
    peak = _peak(image, mask)
    if float(specular.max()) < _MIN_PEAK * peak:
        specular = np.zeros_like(specular)
    forbidden = np.zeros(mask.shape, bool) if prior is None else prior == 0
    split = white_layers(image, mask, specular, None if clipped is None else clipped & ~forbidden)
    unclipped = np.ones(mask.shape, bool) if clipped is None else ~clipped
    abstention = None
    if not _removes(split, unclipped):
        abstention = _abstention(image, mask, photo, ratios, options)
    if options.odds > 0 and split.specular.any():
        split = _without_print(split, image, mask, options.odds, clipped, prior)
        if abstention is None and not _removes(split, unclipped):
            abstention = Abstention.PRINT
    likely = _confidence(image, mask, low, _base(low, mask, peak), split.specular[..., 0])
    for layer in (split.diffuse, split.specular, split.residual):
        if layer.any():  # zero pages that are never written need no memory
            layer *= unit
    return replace(split, confidence=np.where(unclipped, likely, 0), abstention=abstention)


def _removes(split: Separation, unclipped: np.ndarray) -> bool:
    """Whether there is specular light where the photo is not clipped."""
    return bool((split.specular.any(axis=2) & unclipped).any())


def _without_print(
    split: Separation,
    image: np.ndarray,
    mask: np.ndarray,
    odds: float,
    clipped: np.ndarray | None,
    prior: np.ndarray | None,
) -> Separation:
    """The layers where a highlight is likelier than print by `odds`, the photo elsewhere."""
    seen = predict_layers(image, mask)
    form = seen.log_ratio, seen.ratio_scale
    found = classify_highlights(
        image, split.diffuse, mask, *form, odds, clipped=clipped, prior=prior
    )
    return keep_highlights(split, image, found.kept, mask)


def _abstention(
    image: np.ndarray,
    mask: np.ndarray,
    photo: _ObjectMaps,
    ratios: _DiffuseRatios,
    options: IscOptions,
) -> Abstention:
    """Why colour alone removes nothing from `image` (H, W, 3); `photo` are its block averages."""
    if not has_colour(image, mask):
        return Abstention.NO_COLOUR
    share = as_map(ratios.places.read(ratios.share), photo.mask)
    candidate = _specular(photo.low, photo.chroma, share) * ramp(
        photo.low / photo.base, options.bright
    )
    if float(candidate[photo.mask].max()) < _MIN_PEAK * photo.peak:
        return Abstention.NO_CANDIDATE
    if _saturation(photo) <= options.colourful[0]:
        return Abstention.NEAR_GREY
    return Abstention.NOT_PROVEN


def _unit(values: np.ndarray) -> np.float32:
    """A power of two near the largest value: dividing by it is exact, and makes
    the small constants independent of exposure.
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
    if not 0 <= options.odds < np.inf:
        raise InputError(f"odds must be finite and at least 0, such as 1, not {options.odds:g}")
    if not (0 <= options.scatter < np.inf and 0 <= options.scatter_here < np.inf):
        raise InputError("scatter and scatter_here must be finite and at least 0")
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
        raise InputError("the prior must lie within [0, 1] inside the mask")


def _block_averages(
    image: np.ndarray, mask: np.ndarray, usable: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The three arrays downsampled by `factor`: means of the mask's pixels in each block. A block
    is usable if all its pixels are.
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


def _object_maps(image: np.ndarray, mask: np.ndarray, usable: np.ndarray) -> _ObjectMaps:
    smooth = np.where(mask[..., None], masked_gaussian(image, mask, _BY_HUE), 0)
    low, high = smallest(smooth), largest(smooth)
    return _ObjectMaps(image, mask, usable, low, high, hue_of(smooth, low, high))


def _diffuse_ratios(photo: _ObjectMaps, options: IscOptions) -> _DiffuseRatios:
    """Collect the tables from bright, coloured pixels; chroma where the candidate s is small."""
    mask, low, high, chroma = photo.mask, photo.low, photo.high, photo.chroma
    grid = HueGrid(
        (mask.shape[0], mask.shape[1]), max(options.cell * max(mask.shape), 1.0), options.hues
    )
    places = _places(grid, photo, 1)
    weight = (photo.usable & (low > photo.base) & (chroma > photo.base / 2))[mask].astype(
        np.float32
    )
    bins = np.minimum(
        (_BINS * low[mask] / np.maximum(high[mask], _TINY)).astype(np.int64), _BINS - 1
    )
    near, everywhere = grid.histograms(places, bins, _BINS, weight)
    everywhere /= everywhere.sum(axis=-1, keepdims=True)
    near += options.borrowed * everywhere
    share = quantile(near, options.low_quantile)
    candidate = _specular(low[mask], chroma[mask], places.read(share))
    weight *= np.exp(-np.square(candidate / np.maximum(0.1 * high[mask], _TINY)))
    bins = np.minimum(
        (np.clip(chroma[mask] / photo.peak, 0, 1) * (_CHROMA_BINS - 0.01)).astype(np.int64),
        _CHROMA_BINS - 1,
    )
    near, everywhere = grid.histograms(places, bins, _CHROMA_BINS, weight)
    everywhere /= everywhere.sum(axis=-1, keepdims=True)
    near += 20 * everywhere
    return _DiffuseRatios(grid, places, share, quantile(near, 0.5))


def _places(grid: HueGrid, photo: _ObjectMaps, scale: float, first: int = 0) -> Places:
    """Grid positions of the mask's pixels.

    `scale`: size of the photo relative to the image for which the grid was built. `first`: its row
    at which `photo` begins.
    """
    rows, columns = np.nonzero(photo.mask)
    rows += first
    return grid.places(
        (rows + 0.5) / scale - 0.5, (columns + 0.5) / scale - 0.5, photo.hue[photo.mask]
    )


def _specular(low: np.ndarray, chroma: np.ndarray, share: np.ndarray) -> np.ndarray:
    """s = min I - q C, within [0, min I], for the diffuse ratio min D / max D = `share`."""
    return np.clip(low - _ratio(share) * chroma, 0, low)


def _ratio(share: np.ndarray) -> np.ndarray:
    return share / np.maximum(1 - share, np.float32(0.01))


def _candidates(photo: _ObjectMaps, ratios: _DiffuseRatios, options: IscOptions) -> _Candidates:
    """Both candidates for s, with their gains."""
    hue_share, usual_chroma = (
        as_map(ratios.places.read(table), photo.mask)
        for table in (ratios.share, photo.peak * ratios.chroma)
    )
    by_hue = _specular(photo.low, photo.chroma, hue_share)
    edge_weight = far_from_borders(_chroma_steps(photo), photo.mask, blur=1.5, unit=0.6)
    with ThreadPoolExecutor(
        1
    ) as executor:  # the filters release the GIL, and the two candidates are independent
        in_groups = executor.submit(
            grouped_specular,
            photo.image,
            photo.mask,
            photo.usable if photo.usable.any() else photo.mask,
        )
        gain_by_hue = executor.submit(_gain_by_hue, photo, by_hue, hue_share, edge_weight, options)
        by_place, gain_by_place, share = _by_place(
            photo, usual_chroma, edge_weight, in_groups, options
        )
        return _Candidates(by_hue, gain_by_hue.result(), by_place, gain_by_place, share)


def _chroma_steps(photo: _ObjectMaps) -> Steps:
    level = photo.chroma + _DARK * photo.peak
    # Three standard deviations of the difference of two neighbours; smoothing reduces their noise
    # to a third.
    floor = 3 * 0.3 * 1.4 * photo.noise / level / _CHROMA_STEP
    return steps_of([(np.log(level), _CHROMA_STEP)], photo.mask, floor)


def _gain_by_hue(
    photo: _ObjectMaps,
    candidate: np.ndarray,
    share: np.ndarray,
    edge_weight: np.ndarray,
    options: IscOptions,
) -> np.ndarray:
    """The gain (H, W) of the candidate by hue: one factor for the object times local cues."""
    mask, low = photo.mask, photo.low
    bright = ramp(low / photo.base, options.bright)
    specular = candidate * bright
    scale = max(0.015 * photo.diagonal, 2.5)
    rough, rough_here = roughness(specular, edge_weight, mask, scale, fine=1.5)
    gain = float(ramp(_saturation(photo), options.colourful) * ramp(rough, options.smooth))
    if gain > 0:
        gain *= float(ramp(_mixing(photo, specular, share, edge_weight), options.unmixed))
    if gain == 0:
        return np.zeros(mask.shape, np.float32)
    clear = ramp(specular / (options.scatter * (low - specular) + _TINY), options.clear)
    kept = _suppress_borders(specular * ramp(rough_here, options.smooth_here) * clear, edge_weight)
    return np.where(mask, gain * kept / np.maximum(candidate, _TINY), 0)


def _saturation(photo: _ObjectMaps) -> float:
    """Saturation of the bright pixels: the sum of C over that of max I."""
    weight = np.where(photo.mask, ramp(photo.low / photo.base, (0.5, 1.2)), 0)
    brightness = (photo.high * weight).sum(dtype=float)
    return float((photo.chroma * weight).sum(dtype=float) / max(brightness, float(_TINY)))


def _mixing(
    photo: _ObjectMaps, specular: np.ndarray, share: np.ndarray, edge_weight: np.ndarray
) -> float:
    """The median reflectance mixing where the `candidate` (H, W) is strong."""
    inside = np.where(photo.mask, specular, 0)
    smooth = _suppress_borders(inside, np.square(edge_weight), reach=4.0)
    mixing = reflectance_mixing(
        smooth, photo.chroma, _ratio(share), photo.usable, max(0.03 * photo.diagonal, 2.5)
    )
    values = inside[photo.mask]
    return float(np.median(mixing[photo.mask][values >= 0.3 * np.quantile(values, 0.99)]))


def _suppress_borders(
    specular: np.ndarray, edge_weight: np.ndarray, reach: float = 2.5
) -> np.ndarray:
    """`specular` (H, W), limited near edges (low `edge_weight`) to the level around them, within
    `reach` pixels.
    """
    around = weighted_gaussian(specular, edge_weight, reach, 1e-3)
    return edge_weight * specular + (1 - edge_weight) * np.minimum(around, specular)


def _by_place(
    photo: _ObjectMaps,
    usual_chroma: np.ndarray,
    edge_weight: np.ndarray,
    in_groups: "Future[np.ndarray]",
    options: IscOptions,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The candidate by place, its gain and min D / max D, each (H, W).

    `in_groups`: the pending result of `grouped_specular`.
    """
    mask = photo.mask
    smooth = np.where(mask[..., None], masked_gaussian(photo.image, mask, _BY_PLACE), 0)
    low, high = smallest(smooth), largest(smooth)
    chroma = high - low
    observed = low / np.maximum(high, _TINY)
    paths = _paths(smooth, low, chroma, photo)
    weight = photo.usable.astype(np.float32)
    share = paths.lower_mode(observed, weight, _TAU, _ROUNDS)
    ratio, observed_ratio = _ratio(share), _ratio(observed)
    deviation = np.clip((observed_ratio - ratio) / np.maximum(ratio, np.float32(1e-3)), -1, 1)
    scatter = np.sqrt(paths.weighted(np.square(deviation), weight * (deviation <= 0)))
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
        reflectance_mixing(candidate, photo.chroma, ratio, photo.usable, scale),
        options.unmixed_here,
    )
    safe = gain * edge_weight * ramp(1 - share, options.coloured)
    _, rough_here = roughness(candidate * safe, edge_weight, mask, scale, fine=1.5)
    agreed = np.minimum(gain, in_groups.result() / np.maximum(candidate, _TINY))
    proven = np.where(mask, np.maximum(safe * ramp(rough_here, options.smooth_by_place), agreed), 0)
    # A highlight fades out: around proven pixels, weaker candidates belong to it as well.
    around = ndimage.maximum_filter(
        ramp(proven, options.proven), 2 * round(_RIM * photo.diagonal) + 1
    )
    faint = edge_weight * ramp(candidate / np.maximum(error, _TINY), options.faint)
    faint *= ramp(photo.chroma / np.maximum(usual_chroma, _TINY), options.present)
    return candidate, np.where(mask, np.maximum(proven, np.minimum(faint, around)), 0), share


def _paths(smooth: np.ndarray, low: np.ndarray, chroma: np.ndarray, photo: _ObjectMaps) -> Paths:
    """Distances that grow across reflectance edges, and are infinite across the silhouette."""
    dark = _DARK * photo.peak
    free = smooth - low[..., None]
    shares = free / (free.sum(axis=2) + np.float32(dark))[..., None]
    reach = _REACH * photo.diagonal
    steps = steps_of(
        [(shares, _SHARE_STEP), (np.log(chroma + dark), _CHROMA_STEP)], photo.mask, _MIN_STEP
    )
    across, down = 1 + reach * steps.across, 1 + reach * steps.down
    across[:, 1:][photo.mask[:, 1:] != photo.mask[:, :-1]] = 1e6
    down[1:][photo.mask[1:] != photo.mask[:-1]] = 1e6
    return Paths(across, down, reach)


def _of_full_size(
    image: np.ndarray,
    mask: np.ndarray,
    ratios: _DiffuseRatios,
    candidates: _Candidates,
    factor: int,
    prior: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray]:
    """s and the smoothed min I (H, W) of a photo, from the candidates of its block averages."""
    specular, low = np.empty(mask.shape, np.float32), np.empty(mask.shape, np.float32)
    for block in row_blocks(mask.shape, halo=_SMOOTH_REACH):
        wide, first = block.wide, block.rows.start
        maps = _object_maps(image[wide], mask[wide], mask[wide])
        part = maps.rows(block.own)
        places = _places(ratios.grid, part, factor, first)
        hue_share = as_map(places.read(ratios.share), part.mask)
        gain_by_hue, gain_by_place, share = (
            enlarged(layer, part.mask.shape, factor, (first, 0))
            for layer in (candidates.gain_by_hue, candidates.gain_by_place, candidates.share)
        )
        by_hue = _specular(part.low, part.chroma, hue_share)
        by_place = _specular(part.low, part.chroma, share)
        here = None if prior is None else prior[block.rows]
        specular[block.rows] = _combined(
            _Candidates(by_hue, gain_by_hue, by_place, gain_by_place, share), here
        )
        low[block.rows] = part.low
    return specular, low


def _combined(candidates: _Candidates, prior: np.ndarray | None) -> np.ndarray:
    """s, the larger of the two candidates as far as they are gains."""
    return np.maximum(
        candidates.by_hue * _apply_prior(candidates.gain_by_hue, prior),
        candidates.by_place * _apply_prior(candidates.gain_by_place, prior),
    )


def _peak(image: np.ndarray, mask: np.ndarray) -> float:
    return max(float(np.quantile(image[mask], 0.999)), float(_TINY))


def _base(low: np.ndarray, mask: np.ndarray, peak: float) -> float:
    return max(float(low[mask].mean(dtype=float)), float(_TINY) * peak)


def _apply_prior(gain: np.ndarray, prior: np.ndarray | None) -> np.ndarray:
    """The gain with its odds multiplied by the prior's."""
    if prior is None:
        return gain
    accepted, rejected = gain * prior, (1 - gain) * (1 - prior)
    return accepted / np.maximum(accepted + rejected, _TINY)


def _confidence(
    image: np.ndarray, mask: np.ndarray, low: np.ndarray, base: float, specular: np.ndarray
) -> np.ndarray:
    """exp(-e / u) (H, W): the expected error e is a share of s and of what
    the smallest channel could hide.

    On a pale object colour is a weak cue: e is up to three times as large.
    """
    error = (specular + 0.3 * low) * (3 - 2 * saturation_gate(image, mask))
    return np.where(mask, np.exp(-error / base), 0).astype(np.float32)
