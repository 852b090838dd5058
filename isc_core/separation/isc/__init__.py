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

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from ...imaging.row_blocks import row_blocks
from ...imaging.upsampling import enlarged
from ...imaging.window import as_map
from ...networks.scene_network import predict_layers
from ...progress import Monitor
from ...scene.decomposition import Separation
from ...scene.diagnostics import Abstention
from ..sparse_coding import grouped_specular
from ..support.checks import check_arrays, has_colour
from ..support.filter_statistics import highlight_prior
from ..support.highlight_cues import ramp
from ..support.highlight_evidence import classify_highlights
from ..support.layers import keep_highlights, white_layers
from ..support.saturation_gate import saturation_gate
from .by_hue import DiffuseRatios, diffuse_ratios, grid_places, hue_gain, saturation_of
from .by_place import place_candidate
from .object_maps import (
    SMOOTH_REACH,
    TINY,
    ObjectMaps,
    base_of,
    block_averages,
    edge_weights,
    object_maps,
    peak_of,
    specular_of,
)
from .options import VARIANTS, IscOptions, check_options

__all__ = ["VARIANTS", "IscOptions", "separate"]

# Longest side in pixels at which statistics are computed; larger objects are block-averaged.
_MAX_SIDE = 640
# A layer whose maximum stays below this share of the brightest value is dropped: half a step of an
# 8-bit display.
_MIN_PEAK = 1 / 512


@dataclass(frozen=True, eq=False)
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
    check_options(options, prior, mask)
    if options.filters:
        cue = highlight_prior(image, mask)
        prior = cue if prior is None else _apply_prior(cue, prior)
    unit = _unit(image[mask])
    image = (np.where(mask[..., None], image, 0) / unit).astype(np.float32)
    usable = mask if clipped is None else mask & ~clipped
    factor = -(-max(mask.shape) // _MAX_SIDE)
    monitor.report("estimating diffuse colours", 0.0)
    photo = object_maps(*block_averages(image, mask, usable, factor))
    ratios = diffuse_ratios(photo, options)
    monitor.report("testing highlight candidates", 0.3)
    candidates = _candidates(photo, ratios, options)
    monitor.report("removing highlights", 0.8)
    if factor == 1:
        specular, low = _combined(candidates, prior), photo.low
    else:
        specular, low = _of_full_size(image, mask, ratios, candidates, factor, prior)
    peak = peak_of(image, mask)
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
    likely = _confidence(image, mask, low, base_of(low, mask, peak), split.specular[..., 0])
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
    photo: ObjectMaps,
    ratios: DiffuseRatios,
    options: IscOptions,
) -> Abstention:
    """Why colour alone removes nothing from `image` (H, W, 3); `photo` are its block averages."""
    if not has_colour(image, mask):
        return Abstention.NO_COLOUR
    share = as_map(ratios.places.read(ratios.share), photo.mask)
    candidate = specular_of(photo.low, photo.chroma, share) * ramp(
        photo.low / photo.base, options.bright
    )
    if float(candidate[photo.mask].max()) < _MIN_PEAK * photo.peak:
        return Abstention.NO_CANDIDATE
    if saturation_of(photo) <= options.colourful[0]:
        return Abstention.NEAR_GREY
    return Abstention.NOT_PROVEN


def _unit(values: np.ndarray) -> np.float32:
    """A power of two near the largest value: dividing by it is exact, and makes
    the small constants independent of exposure.
    """
    return np.float32(2.0 ** np.ceil(np.log2(max(float(values.max()), 1e-30))))


def _candidates(photo: ObjectMaps, ratios: DiffuseRatios, options: IscOptions) -> _Candidates:
    """Both candidates for s, with their gains."""
    hue_share, usual_chroma = (
        as_map(ratios.places.read(table), photo.mask)
        for table in (ratios.share, photo.peak * ratios.chroma)
    )
    by_hue = specular_of(photo.low, photo.chroma, hue_share)
    edge_weight = edge_weights(photo)
    # The filters release the GIL, and the two candidates are independent.
    with ThreadPoolExecutor(1) as executor:
        in_groups = executor.submit(
            grouped_specular,
            photo.image,
            photo.mask,
            photo.usable if photo.usable.any() else photo.mask,
        )
        gain_by_hue = executor.submit(hue_gain, photo, by_hue, hue_share, edge_weight, options)
        by_place, gain_by_place, share = place_candidate(
            photo, usual_chroma, edge_weight, in_groups, options
        )
        return _Candidates(by_hue, gain_by_hue.result(), by_place, gain_by_place, share)


def _of_full_size(
    image: np.ndarray,
    mask: np.ndarray,
    ratios: DiffuseRatios,
    candidates: _Candidates,
    factor: int,
    prior: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray]:
    """s and the smoothed min I (H, W) of a photo, from the candidates of its block averages."""
    specular, low = np.empty(mask.shape, np.float32), np.empty(mask.shape, np.float32)
    for block in row_blocks(mask.shape, halo=SMOOTH_REACH):
        wide, first = block.wide, block.rows.start
        maps = object_maps(image[wide], mask[wide], mask[wide])
        part = maps.rows(block.own)
        places = grid_places(ratios.grid, part, factor, first)
        hue_share = as_map(places.read(ratios.share), part.mask)
        gain_by_hue, gain_by_place, share = (
            enlarged(layer, part.mask.shape, factor, (first, 0))
            for layer in (candidates.gain_by_hue, candidates.gain_by_place, candidates.share)
        )
        by_hue = specular_of(part.low, part.chroma, hue_share)
        by_place = specular_of(part.low, part.chroma, share)
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


def _apply_prior(gain: np.ndarray, prior: np.ndarray | None) -> np.ndarray:
    """The gain with its odds multiplied by the prior's."""
    if prior is None:
        return gain
    accepted, rejected = gain * prior, (1 - gain) * (1 - prior)
    return accepted / np.maximum(accepted + rejected, TINY)


def _confidence(
    image: np.ndarray, mask: np.ndarray, low: np.ndarray, base: float, specular: np.ndarray
) -> np.ndarray:
    """exp(-e / u) (H, W): the expected error e is a share of s and of what
    the smallest channel could hide.

    On a pale object colour is a weak cue: e is up to three times as large.
    """
    error = (specular + 0.3 * low) * (3 - 2 * saturation_gate(image, mask))
    return np.where(mask, np.exp(-error / base), 0).astype(np.float32)
