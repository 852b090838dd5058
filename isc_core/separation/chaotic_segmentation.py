"""Highlight removal by chaotic multilevel thresholds and inpainting (CS; Akbar 2016).

Problem: a pixel is diffuse plus white specular, I = D + s (1, 1, 1). Find the pixels with s > 0,
and what lies beneath.

Equation: first, Otsu's K thresholds of the smallest channel min I, in which white light stands out
and saturated reflectance does not, found by the clonal selection whose random numbers come from a
logistic map (`thresholding`); the pixels above the highest one are specular. Second, they are a
hole that is filled from the other pixels of the object by patches matched with Coherency Sensitive
Hashing (`inpainting`). As published ("colour"): D = min(I, fill), K = 3. Ours ("ratio", K = 1):
highlights are white, so F = I - min I is known under them. The patches match in the colour of F, F
/ (sum F + e), and transfer only what the highlight hides, the ratio q = min D / (max D - min D) of
their reflectance, which shading does not change: s = min I - q (max I - min I), nowhere below 0.
Around each hole a rim is processed as well; pixels without a highlight, whose q agrees, stay
unchanged. The whole s fades out on grey objects (`saturation_gate`).

Citation: H. Akbar, "3D intrinsic scene characteristics extraction framework for a single image",
PhD thesis (2016). H. Akbar, N. Suryana and S. Sahib, IJSISE 8(5) (2015), on the chaotic clonal
selection. Matching: S. Korman and S. Avidan (2011), doi:10.1109/ICCV.2011.6126421. Filling: Y.
Wexler, E. Shechtman and M. Irani (2007), doi:10.1109/TPAMI.2007.60.

Limits: the light must be white. Otsu's brightest class exists in every photo, with or without
highlights: as published, the method repaints bright reflectance too. A reflectance that occurs only
under highlights gets the ratio of the most similar one.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import InputError
from ..filters.distance import distance_to
from ..imaging.channels import largest, smallest
from ..inpainting.coherency_sensitive_hashing import (
    CshOptions,
    CshSearch,
    patches_touching,
    patches_within,
)
from ..inpainting.patch_fill import PatchFillOptions, fill_patches
from ..inpainting.pull_push import fill
from ..inpainting.voting import vote
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..thresholding import OPTIMISERS, OtsuObjective, maximise, quantise
from .support.checks import check_arrays, require_colour
from .support.layers import diffuse_layers, white_layers
from .support.saturation_gate import saturation_gate


@dataclass(frozen=True)
class ChaoticSegmentationOptions:
    """Options of chaotic segmentation.

    Attributes
    ----------
    levels : int
        Number K of thresholds that split the smallest channel, 1 to 16; pixels above the highest
        are specular.
    optimiser : Literal['chaotic_clonal', 'clonal_selection', 'particle_swarm', 'exact']
        Their optimiser: chaotic_clonal, clonal_selection, particle_swarm, or exact.
    evaluations : int
        The search's budget.
    seed : int
        Of the search and of the matching, >= 0.
    threshold : float or None
        Instead of searching, a share of the largest value of the smallest channel, between 0 and 1.
    repaint : Literal['ratio', 'colour']
        "ratio" removes white light only, "colour" replaces the whole pixel, as published.
    rim : float
        Width of the rim around them that is processed too, a share of the square root of the
        object's area, 0 to 1.
    guard : bool
        Leave grey objects unchanged.
    """

    levels: int = 1
    optimiser: Literal["chaotic_clonal", "clonal_selection", "particle_swarm", "exact"] = (
        "chaotic_clonal"
    )
    evaluations: int = 20_000
    seed: int = 0
    threshold: float | None = None
    repaint: Literal["ratio", "colour"] = "ratio"
    rim: float = 0.01
    guard: bool = True


VARIANTS = {
    "improved": ChaoticSegmentationOptions(),
    "paper": ChaoticSegmentationOptions(levels=3, repaint="colour", rim=0.0, guard=False),
}

_TABLES = 3
# F below this share of the object's mean is treated as noise, without a colour.
_FAINT = 0.2


def separate(
    image: np.ndarray,
    mask: np.ndarray,
    options: ChaoticSegmentationOptions | None = None,
    clipped: np.ndarray | None = None,
    monitor: Monitor | None = None,
) -> Separation:
    """Separate a photo under white light into its diffuse and specular layer.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear Rec.709, not negative, of any exposure.
    mask : (H, W) bool ndarray
    options : ChaoticSegmentationOptions, optional
        By default the improved variant.
    clipped : (H, W) bool ndarray, optional
        Pixels whose true value lies above the recorded one: they are never a source.
    monitor : Monitor, optional

    Returns
    -------
    Separation
        Inside the mask 0 <= diffuse <= image; the specular layer has three equal channels unless
        colours are repainted.

    Raises
    ------
    InputError
        If shapes or options are invalid, the mask is empty, values inside it are negative or not
        finite, or the photo has no colour.
    Cancelled
        If the user cancels.
    """
    options = options or ChaoticSegmentationOptions()
    monitor = monitor or Monitor()
    check_arrays(image, mask, clipped)
    _check_options(options)
    if options.repaint == "ratio":
        require_colour(image, mask, "chaotic_segmentation")
    inside = np.where(mask[..., None], image, 0)
    peak = float(inside.max())
    scaled = (inside / max(peak, 1e-30)).astype(np.float32)
    monitor.report("finding highlights", 0.0)
    specular = find_specular(scaled, mask, options)
    if options.rim > 0 and specular.any():
        reach = max(1.0, options.rim * float(np.sqrt(mask.sum())))
        specular = mask & (distance_to(specular) <= reach)
    valid = mask & ~specular if clipped is None else mask & ~specular & ~clipped
    if not specular.any() or not valid.any():
        return white_layers(inside, mask, np.zeros(mask.shape), clipped)
    if options.repaint == "colour":
        filled = _filled_image(scaled, valid, specular, options, monitor.part(0.1, 1.0))
        return diffuse_layers(
            inside, mask, np.where(specular[..., None], filled * peak, inside), clipped
        )
    share = saturation_gate(scaled, valid | specular) * peak if options.guard else peak
    if share == 0:
        return white_layers(inside, mask, np.zeros(mask.shape), clipped)
    removed = share * _ratio_specular(scaled, valid, specular, options, monitor.part(0.1, 1.0))
    return white_layers(inside, mask, removed, clipped)


def find_specular(
    image: np.ndarray, mask: np.ndarray, options: ChaoticSegmentationOptions
) -> np.ndarray:
    """Return the specular pixels: those above the highest threshold of the smallest channel.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    options : ChaoticSegmentationOptions

    Returns
    -------
    (H, W) bool ndarray
        None are set if the brightest and the darkest pixel have the same level.

    Raises
    ------
    InputError
        If the search is not possible.
    """
    low = smallest(np.where(mask[..., None], image, 0))
    peak = float(low.max())
    if peak <= 0:
        return np.zeros_like(mask)
    if options.threshold is not None:
        return mask & (low > options.threshold * peak)
    levels = quantise(low, peak)
    if np.ptp(levels[mask]) == 0:
        return np.zeros_like(mask)
    objective = OtsuObjective.of(levels[mask])
    optimum = maximise(
        options.optimiser,
        objective,
        options.levels,
        evaluations=options.evaluations,
        seed=options.seed,
    )
    return mask & (levels > optimum.thresholds[-1])


def _check_options(options: ChaoticSegmentationOptions) -> None:
    if not 1 <= options.levels <= 16 or options.seed < 0 or options.evaluations < 1:
        raise InputError(
            "levels must lie between 1 and 16, seed at 0 or above, evaluations at 1 or above"
        )
    if options.optimiser not in OPTIMISERS or options.repaint not in ("ratio", "colour"):
        raise InputError(
            f"optimiser must be one of {', '.join(OPTIMISERS)}, repaint ratio or colour"
        )
    if not 0 <= options.rim <= 1:
        raise InputError("rim must lie between 0 and 1, as a share of the object's size")
    if options.threshold is not None and not 0 < options.threshold < 1:
        raise InputError(
            "threshold must lie between 0 and 1, a share of the brightest value, not "
            f"{options.threshold}"
        )


def _filled_image(
    image: np.ndarray,
    valid: np.ndarray,
    specular: np.ndarray,
    options: ChaoticSegmentationOptions,
    monitor: Monitor,
) -> np.ndarray:
    """The image (H, W, 3) with specular pixels filled from valid ones."""
    defaults = PatchFillOptions()
    matching = CshOptions(
        tables=defaults.matching.tables, candidates=defaults.matching.candidates, seed=options.seed
    )
    return fill_patches(image, valid, specular, PatchFillOptions(matching=matching), monitor)


def _ratio_specular(
    image: np.ndarray,
    valid: np.ndarray,
    specular: np.ndarray,
    options: ChaoticSegmentationOptions,
    monitor: Monitor,
) -> np.ndarray:
    """The specular layer (H, W) of the specular pixels; 0 elsewhere."""
    low = smallest(image)
    chroma = largest(image) - low
    # The ratio is voted as two sums, numerator and denominator: saturated pixels, whose ratio is
    # reliable, weigh most.
    sums = np.stack([low, chroma], axis=2)
    means = fill(sums, valid)
    hue = _invariant_colour(image, low, valid | specular)
    source, target = patches_within(hue, valid), patches_touching(hue, specular)
    if len(source) and len(target):
        matches = CshSearch(source, CshOptions(tables=_TABLES, seed=options.seed)).match(
            target, monitor=monitor
        )
        votes, has_votes = vote(sums, target, source, matches)
        means = np.where(has_votes[..., None], votes, means)
    ratio = means[..., 0] / np.maximum(means[..., 1], 1e-6)
    return np.where(specular, np.clip(low - ratio * chroma, 0, low), 0)


def _invariant_colour(image: np.ndarray, low: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """F / (sum F + e), F = I - min I (H, W, 3): invariant to highlights, nearly so to shading;
    extrapolated beyond the mask.
    """
    specular_free = image - low[..., None]
    total = specular_free.sum(axis=2)
    colour = specular_free / (total + max(_FAINT * float(total[mask].mean()), 1e-12))[..., None]
    return fill(colour, mask)
