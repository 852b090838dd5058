"""Colour and form decide together whether removed light was a highlight, region by region.

Problem: white letters, stripes and labels on strong colour have the colour of highlights, and a
network that uses form is uncertain about them. Each kind of evidence alone sometimes mistakes print
for highlights; removing paint by mistake does more harm than leaving a highlight.

Equation: the removed light s = I - D falls into connected regions. With the log ratio y of image
and diffuse image that the scene network expects, its scale b, the smallest channel m and the chroma
C = max I - min I, the log odds that removing s lowers the squared error are

    w_0 + w_1 mean(y) / mean(b) + w_2 mean(saturation of D) + w_3 q (saturation of the ring),

where means are weighted by s^2 and q, at most 1/2, is the slope of C against m over the region's
flanks and a ring around it. White light raises all channels alike: where m rises, C stays. White
paint replaces the paint around it: where m rises, C falls. Clipped pixels would show a falling C in
either case; they and their neighbours are left out. Where they are more than three quarters of the
flanks, the slope is that of the ring alone: on matt paint, shading raises C and m there, so a
positive q then counts as 0. Grey paint has no chroma to decide by. The s of
a region is kept where the odds exceed `odds`; otherwise the image is restored, bit for bit. Marks
of a user decide about the nearest region.

Citation: logistic regression: D. R. Cox 1958, doi:10.1111/j.2517-6161.1958.tb00292.x. That a
highlight leaves C unchanged: K.-J. Yoon, Y. Choi, I. S. Kweon 2006, doi:10.1109/ICIP.2006.312650.
The weights are those of `benchmarks.separation.print_rule --mixed` on rendered objects, half of
them with print, and of a former scene network; docs/methods/print.md explains why they were kept,
all but the constant, and how that and the odds were chosen.

Limits: a region that contains both a highlight and print is kept or restored as a whole. Pale print
of the same chroma as the paint around it looks like light. Coloured light changes C, as paint does.
Faint and broad highlights, which the network predicts with large scales, stay in the image, as do
most on grey and white.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...filters.components import boxes, labelled, means
from ...filters.distance import distances, nearest_pixels
from ...filters.morphology import dilated
from ...imaging.bounding_box import mask_diagonal
from ...imaging.channels import largest, mean_channel, smallest
from ...photo.highlight_marks import HighlightMarks, Place, mark_radius

_FAINT = 0.01  # of the bright pixels: less removed light joins no regions
_DARK = 0.02  # of the bright pixels: added to what a chroma is divided by
_CORE, _FLANK = 0.5, 0.2  # of a region's peak
_RING = 0.02  # distance of the ring, of the object's diagonal
_LEAST, _FEWEST = 6, 3  # pixels: of a region that can be classified, of its flanks
_MOST_RATIO = 6.0  # of mean y over mean b
_SLOPES = (-1.0, 0.5)  # of C against m: above, shading does more than light
_CLEAR = 0.25  # of a region's flanks: with fewer unclipped pixels the slope is the ring's
WEIGHTS = (-2.545, 0.706, 2.099, 4.585)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence of each of the K regions of removed light.

    Attributes
    ----------
    labels : (H, W) ndarray of int
        Number of the region at each pixel, from 1; 0 outside of all regions.
    numbers : (K,) ndarray of int
        Those of the regions that can be classified.
    values : (K, 3) ndarray
        y over b, the saturation of D, and the slope of C times the saturation of the ring.
    """

    labels: np.ndarray
    numbers: np.ndarray
    values: np.ndarray


def highlight_evidence(
    image: np.ndarray,
    diffuse: np.ndarray,
    mask: np.ndarray,
    log_ratio: np.ndarray,
    ratio_scale: np.ndarray,
    clipped: np.ndarray | None = None,
) -> Evidence:
    """Compute the evidence of each region of removed light.

    Parameters
    ----------
    image, diffuse : (H, W, 3) ndarray
        Linear; `diffuse` is at most `image`.
    mask : (H, W) ndarray of bool
        The object.
    log_ratio : (H, W, 3) ndarray
        y.
    ratio_scale : (H, W) ndarray
        b.
    clipped : (H, W) ndarray of bool, optional
        Pixels whose true value lies above the recorded one.

    Returns
    -------
    Evidence
    """
    removed = np.where(mask, mean_channel(image) - mean_channel(diffuse), 0).astype(float)
    bright = float(np.quantile(mean_channel(image)[mask], 0.99))
    labels, count = labelled(removed > max(_FAINT * bright, 1e-12))
    dark = _DARK * bright + 1e-12
    clear = mask if clipped is None else mask & ~dilated(clipped)
    # whole pixels; the ring beyond it is two wide
    reach = max(2, int(_RING * mask_diagonal(mask)))
    numbers, found = list[int](), list[list[float]]()
    for k, box in enumerate(boxes(labels, count), 1):
        wide = tuple(slice(max(0, one.start - reach - 3), one.stop + reach + 3) for one in box)
        inside = labels[wide] == k
        if inside.sum() < _LEAST:
            continue
        numbers.append(k)
        compared, ring, shown = _surroundings(inside, removed[wide], mask[wide], clear[wide], reach)
        weight = np.square(removed[wide]) * inside
        form = log_ratio[wide], ratio_scale[wide]
        found.append(
            [
                *_form_and_saturation(weight, diffuse[wide], *form, dark),
                _chroma_rise(image[wide], compared, ring, dark, rises=shown),
            ]
        )
    return Evidence(labels, np.array(numbers, int), np.array(found).reshape(-1, len(WEIGHTS) - 1))


def _surroundings(
    inside: np.ndarray, removed: np.ndarray, mask: np.ndarray, clear: np.ndarray, reach: int
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Flanks and ring of a region together, without clipped pixels, and the ring, (h, w) bool; and
    whether enough of the flanks is not clipped.
    """
    peak = float(np.quantile(removed[inside], 0.95))
    core = inside & (removed > _CORE * peak)
    near = dilated(core, reach)
    ring = dilated(near, 2) & ~near & mask & (removed < _CORE * peak)
    if ring.sum() < _LEAST - 1:
        ring = mask & ~core
    ring = ring if ring.any() else mask
    sides = inside & (removed > _FLANK * peak)
    flanks = sides & clear
    shown = bool(flanks.sum() >= _CLEAR * sides.sum())
    both = (flanks if flanks.sum() >= _FEWEST else core) | ring
    return both & clear if (both & clear).sum() >= _LEAST else both, ring, shown


def _form_and_saturation(
    weight: np.ndarray,
    diffuse: np.ndarray,
    log_ratio: np.ndarray,
    ratio_scale: np.ndarray,
    dark: float,
) -> tuple[float, float]:
    """The first two numbers of a region, with weights (h, w)."""
    maps = mean_channel(log_ratio), ratio_scale, _saturation(diffuse, dark)
    y, b, paint = (float((weight * one).sum()) for one in maps)
    ratio = float(np.clip(y / max(b, 1e-12), -_MOST_RATIO, _MOST_RATIO))
    return ratio, paint / max(float(weight.sum()), 1e-12)


def _chroma_rise(
    image: np.ndarray, compared: np.ndarray, ring: np.ndarray, dark: float, *, rises: bool
) -> float:
    """The last number of a region: q, limited, times the saturation of the ring; q above 0 counts
    only if `rises`.
    """
    image = image.astype(float)
    low = smallest(image)
    light, chroma = low[compared], (largest(image) - low)[compared]
    light = light - light.mean()
    slope = float((light * chroma).sum()) / max(float(np.square(light).sum()), (1e-3 * dark) ** 2)
    limited = float(np.clip(slope, _SLOPES[0], _SLOPES[1] if rises else 0.0))
    return limited * float(np.median(_saturation(image, dark)[ring]))


def _saturation(image: np.ndarray, dark: float) -> np.ndarray:
    high = largest(image)
    return np.asarray((high - smallest(image)) / (high + dark))


@dataclass(frozen=True, eq=False)
class ClassifiedHighlights:
    """Where removed light was a highlight.

    Attributes
    ----------
    kept : (H, W) ndarray of bool
        False in regions that are restored, and outside of all regions.
    doubtful : float
        Share of the image's light in regions that are restored although a highlight is likelier
        than print.
    """

    kept: np.ndarray
    doubtful: float


def classify_highlights(
    image: np.ndarray,
    diffuse: np.ndarray,
    mask: np.ndarray,
    log_ratio: np.ndarray,
    ratio_scale: np.ndarray,
    odds: float,
    marks: HighlightMarks | None = None,
    clipped: np.ndarray | None = None,
    prior: np.ndarray | None = None,
) -> ClassifiedHighlights:
    """Decide where removed light was a highlight.

    Parameters
    ----------
    image, diffuse : (H, W, 3) ndarray
        Linear; `diffuse` is at most `image`.
    mask : (H, W) ndarray of bool
        The object.
    log_ratio : (H, W, 3) ndarray
        y.
    ratio_scale : (H, W) ndarray
        b.
    odds : float
        Least odds of a highlight; larger ones keep less, 0 keeps every region that can be
        classified.
    marks : HighlightMarks, optional
        Decide without the odds; paint before highlights.
    clipped : (H, W) ndarray of bool, optional
        Pixels whose true value lies above the recorded one.
    prior : (H, W) ndarray, optional
        Probability of a highlight before the evidence, in [0, 1]; its mean over a region counts.

    Returns
    -------
    ClassifiedHighlights
    """
    seen = highlight_evidence(image, diffuse, mask, log_ratio, ratio_scale, clipped)
    score = WEIGHTS[0] + (seen.values * WEIGHTS[1:]).sum(axis=1)
    if prior is not None and len(seen.numbers):
        share = means(prior, seen.labels, int(seen.labels.max()))[seen.numbers - 1]
        with np.errstate(divide="ignore"):  # certain: odds of 0 or infinity
            score = score + np.log(share) - np.log1p(-share)
    kept = np.isin(seen.labels, seen.numbers[np.exp(score) > odds])
    doubtful = np.isin(seen.labels, seen.numbers[score > 0]) & ~kept
    if marks:
        lit, paint = (_marked(seen.labels, one, mask) for one in (marks.highlights, marks.paint))
        kept, doubtful = (kept | lit) & ~paint, doubtful & ~lit & ~paint
    return ClassifiedHighlights(kept, _share_of_light(image, diffuse, doubtful, mask))


def _share_of_light(
    image: np.ndarray, diffuse: np.ndarray, where: np.ndarray, mask: np.ndarray
) -> float:
    """Light of the image that the diffuse image lacks there, of all on the object."""
    if not where.any():
        return 0.0
    lost = image[where].astype(float) - diffuse[where]
    return float(lost.sum() / max(float(image[mask].sum(dtype=float)), 1e-12))


def _marked(labels: np.ndarray, places: Sequence[Place], mask: np.ndarray) -> np.ndarray:
    """(H, W) bool: the regions nearest to places, where there is one near."""
    found = np.zeros(labels.shape, bool)
    if not places or not labels.any():
        return found
    nearest = nearest_pixels(labels > 0)
    distance = distances(*nearest)
    reach = mark_radius(mask)
    for x, y in places:
        at = (min(int(y), labels.shape[0] - 1), min(int(x), labels.shape[1] - 1))
        if distance[at] <= reach:
            found |= labels == labels[nearest[0][at], nearest[1][at]]
    return found
