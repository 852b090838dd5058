"""Colour and form decide together whether removed light was a highlight, region by region.

Problem: white letters, stripes and labels on strong colour have the colour of highlights, and a
network that knows form is not sure of them. Each kind of evidence alone takes print for highlights
now and then; light that is wrongly taken off does more harm than a highlight that stays.

Equation: the removed light s = I - D falls into connected regions. With the log ratio y of image
and diffuse image that the scene network expects, its scale b, and for a map v the step

    step(v) = median log v in the region's core - median log v in a ring around it,

the log odds that taking s off lowers the squared error are

    w_0 + w_1 mean(y) / mean(b) + w_2 step(C) + w_3 step(D) + w_4 mean(saturation of D),

with C = max I - min I, which a highlight leaves and white paint lowers; means are weighted by s^2.
What is left under a highlight on saturated paint is saturated; on grey, colour proves nothing. A
region keeps its s where the odds exceed `odds`, and otherwise gives all of it back, bit for bit.
Where a person has marked a highlight, or paint, the nearest region is what the mark says.

Citation: logistic regression: D. R. Cox 1958, doi:10.1111/j.2517-6161.1958.tb00292.x. The weights
are those of `benchmarks.separation.print_rule --mixed` on rendered bodies, half of them with print;
docs/methods/print.md says how the odds were chosen.

Limits: a region that holds both, a highlight and print, is kept or given back as a whole. Faint and
broad highlights, of which the network is not sure, are given back, and most on grey and white.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...imaging.bounding_box import mask_diagonal
from ...imaging.channels import largest, mean_channel, smallest
from ...photo.highlight_marks import HighlightMarks, Place, mark_reach

_FAINT = 0.01  # of the bright pixels: less removed light joins no regions
_DARK = 0.02  # of the bright pixels: added before logarithms
_CORE, _RING = 0.5, 0.02  # of a region's peak; distance of the ring, of the object's diagonal
_LEAST = 6  # pixels of a region that can be judged
_MOST_STEP = 5.0  # of each number that is weighed
WEIGHTS = (-1.725, 0.948, 0.602, -0.337, 2.064)


@dataclass(frozen=True)
class Evidence:
    """What speaks for the regions of removed light, K of them.

    Attributes
    ----------
    labels : (H, W) ndarray of int
        Number of the region at each pixel, from 1 on; 0 outside of all regions.
    numbers : (K,) ndarray of int
        Those of the regions that can be judged.
    values : (K, 4) ndarray
        y over b, the steps of C and D, and the saturation of D.
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
) -> Evidence:
    """Collect what speaks for each region of removed light.

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

    Returns
    -------
    Evidence
    """
    removed = np.where(mask, mean_channel(image) - mean_channel(diffuse), 0).astype(float)
    bright = float(np.quantile(mean_channel(image)[mask], 0.99))
    labels, count = ndimage.label(removed > max(_FAINT * bright, 1e-12))
    dark = _DARK * bright + 1e-12
    # whole pixels; the ring beyond it is two wide
    reach = max(2, int(_RING * mask_diagonal(mask)))
    numbers, found = list[int](), list[list[float]]()
    for k, box in enumerate(ndimage.find_objects(labels, count), 1):
        wide = tuple(slice(max(0, one.start - reach - 3), one.stop + reach + 3) for one in box)
        inside = labels[wide] == k
        if inside.sum() < _LEAST:
            continue
        numbers.append(k)
        maps = _steps_of(image[wide], diffuse[wide], dark)
        form = _form(diffuse[wide], log_ratio[wide], ratio_scale[wide], dark)
        found.append(_values(inside, removed[wide], mask[wide], maps, form, reach))
    return Evidence(labels, np.array(numbers, int), np.array(found).reshape(-1, 4))


def _steps_of(image: np.ndarray, diffuse: np.ndarray, dark: float) -> np.ndarray:
    """Logarithms of C and of D (h, w, 2)."""
    chroma = largest(image) - smallest(image)
    return np.stack(
        [np.log(np.maximum(one, 0) + dark) for one in (chroma, mean_channel(diffuse))], axis=2
    )


def _form(
    diffuse: np.ndarray, log_ratio: np.ndarray, ratio_scale: np.ndarray, dark: float
) -> np.ndarray:
    """y, b and the saturation of D (h, w, 3)."""
    saturation = (largest(diffuse) - smallest(diffuse)) / (largest(diffuse) + dark)
    return np.stack([mean_channel(log_ratio), ratio_scale, saturation], axis=2).astype(float)


def _values(
    inside: np.ndarray,
    removed: np.ndarray,
    mask: np.ndarray,
    maps: np.ndarray,
    form: np.ndarray,
    reach: int,
) -> list[float]:
    """The numbers of one region, `inside` (h, w), on its box."""
    half = _CORE * float(np.quantile(removed[inside], 0.95))
    core = inside & (removed > half)
    near = ndimage.binary_dilation(core, iterations=reach)
    ring = ndimage.binary_dilation(near, iterations=2) & ~near & mask & (removed < half)
    ring = ring if ring.sum() >= _LEAST - 1 else mask & ~core
    weight = np.square(removed) * inside
    y, b, saturation = (weight[..., None] * form).sum(axis=(0, 1))
    steps = (
        np.median(maps[core], axis=0) - np.median(maps[ring], axis=0) if ring.any() else np.zeros(2)
    )
    saturation /= max(float(weight.sum()), 1e-12)
    values = np.clip([y / max(b, 1e-12), *steps, saturation], -_MOST_STEP, _MOST_STEP)
    return [float(one) for one in values]


def supported(
    image: np.ndarray,
    diffuse: np.ndarray,
    mask: np.ndarray,
    log_ratio: np.ndarray,
    ratio_scale: np.ndarray,
    odds: float,
    marks: HighlightMarks | None = None,
) -> np.ndarray:
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
        To be exceeded; larger ones keep less, 0 keeps every region that can be judged.
    marks : HighlightMarks, optional
        Decide without the odds; paint before highlights.

    Returns
    -------
    (H, W) ndarray of bool
        False in regions that give their light back, and outside of all regions.
    """
    seen = highlight_evidence(image, diffuse, mask, log_ratio, ratio_scale)
    score = WEIGHTS[0] + (seen.values * WEIGHTS[1:]).sum(axis=1)
    kept = np.isin(seen.labels, seen.numbers[np.exp(score) > odds])
    if marks:
        kept |= _marked(seen.labels, marks.highlights, mask)
        kept &= ~_marked(seen.labels, marks.paint, mask)
    return kept


def _marked(labels: np.ndarray, places: Sequence[Place], mask: np.ndarray) -> np.ndarray:
    """(H, W) bool: the regions nearest to places, where there is one near."""
    found = np.zeros(labels.shape, bool)
    if not places or not labels.any():
        return found
    distance, nearest = ndimage.distance_transform_edt(labels == 0, return_indices=True)
    reach = mark_reach(mask)
    for x, y in places:
        at = (min(int(y), labels.shape[0] - 1), min(int(x), labels.shape[1] - 1))
        if distance[at] <= reach:
            found |= labels == labels[tuple(nearest[(slice(None), *at)])]
    return found
