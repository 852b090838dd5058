"""The mask of the object in a photo.

Problem: a photo without a mask, an alpha channel or a plain border shows an object in front of
something else.

Equation: the first pass of the network (`networks.mask_network`) uses the whole photo, the second
pass a crop around the result, in which the object is larger. The second pass averages two
predictions, in frames of 96 and of 128 pixels, because their errors differ. `evidence` gives the
confidence of the mask, and `refinement` brings it to the photo's own pixels.

Citation: see `networks.mask_network` and `refinement`; an object reaches the sides of its box: V.
Lempitsky et al. 2009, doi:10.1109/ICCV.2009.5459262. Where the network's mask does not, the box is
segmented by colours alone (`photo.grabcut`).

Limits: measured in docs/methods/automatic_mask.md.
"""

from dataclasses import replace

import numpy as np
from scipy import ndimage

from ..imaging.bounding_box import mask_box
from ..imaging.resampling import resampled
from ..networks.mask_network import Count, MaskNetwork
from ..photo.found_mask import FoundMask
from ..photo.grabcut import Box, grabcut
from ..photo.masks import tidy_mask
from .evidence import confidence_of, evidence_of, no_evidence, of_another_mask
from .frames import Part, PartPrediction, predict_part
from .hints import Hints
from .refinement import refined

WORKING = 768  # pixels of the longer side of the photo that is worked on
_SIDES = (96, 128)  # pixels of the network's frame in the second pass
_MARGIN = 0.25  # of the object's longer side, around it in the second pass
_FILLED = 0.75  # of the sides of a box: a smaller mask is not what the box was drawn around
_SEEN = 0.5  # of a mask in a box the network has to have seen: cuts spread among similar colours
_NOTHING = 0.5  # probability from which a photo shows no objects


def find_mask(
    light: np.ndarray, hints: Hints | None = None, network: MaskNetwork | None = None
) -> FoundMask:
    """Find the object in a photo.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
        Linear, finite, not negative; 1 is white.
    hints : Hints, optional
        Checked against the photo's size.
    network : MaskNetwork, optional
        By default the shipped one.

    Returns
    -------
    FoundMask
        The mirrored photo's is mirrored.
    """
    hints = hints or Hints()
    small, given = _working(light, hints)
    whole = predict_part(small, _all_of(small), given, network)
    found = _at_size(_second_look(small, whole, given, network), light.shape)
    if hints.box is None or hints.points or _fills(found.mask, hints.box):
        return replace(found, confidence=found.confidence * _obeyed(found.mask, hints))
    cover = grabcut(light, hints.box).astype(np.float32)
    weights = (network or MaskNetwork.shipped()).confidence_weights
    evidence = of_another_mask(found.evidence, found.cover, cover)
    confidence = confidence_of(evidence, weights)
    return replace(found, cover=cover, evidence=evidence, confidence=confidence)


def _obeyed(mask: np.ndarray, hints: Hints) -> float:
    """The share of points that a mask holds or leaves out as it should; a right one does of all."""
    told = [bool(mask[y, x]) for x, y in hints.points]
    told += [not mask[y, x] for x, y in hints.others]
    return sum(told) / len(told) if told else 1.0


def _fills(mask: np.ndarray, box: Box) -> bool:
    """Whether a mask is about as wide and as high as the box that was drawn around the object."""
    if not mask.any():
        return False
    width, height = mask_box(mask)[2:]
    return width >= _FILLED * box[2] and height >= _FILLED * box[3]


def find_masks(light: np.ndarray, network: MaskNetwork | None = None) -> list[FoundMask]:
    """Find each of several separate objects in a photo.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
        As for `find_mask`.
    network : MaskNetwork, optional

    Returns
    -------
    list of FoundMask
        From left to right; objects that do not touch. Empty, if there is none.
    """
    small, hints = _working(light, Hints())
    whole = predict_part(small, _all_of(small), hints, network)
    if whole.counts[Count.NONE] > _NOTHING:
        return []
    found = []
    for box in _boxes(_second_look(small, whole, hints, network).mask):
        seen = predict_part(small, _all_of(small), Hints(box=box), network)
        if (seen.cover > 0.5).any():
            one = _second_look(small, seen, Hints(box=box), network)
            found.append(_at_size(one, light.shape))
    return found


def separate_parts(mask: np.ndarray, share: float = 0.1) -> list[np.ndarray]:
    """Return the parts of a mask that do not touch, but for small ones.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    share : float
        Of the largest one's pixels that a part has at least.

    Returns
    -------
    list of (H, W) bool ndarray
        From left to right.
    """
    labels, _ = ndimage.label(mask, np.ones((3, 3)))
    areas = np.bincount(labels.ravel())
    areas[0] = 0
    chosen = np.flatnonzero(areas >= max(share * areas.max(), 1))
    parts = [labels == number for number in chosen]
    return sorted(parts, key=lambda part: mask_box(part)[:2])


def _boxes(mask: np.ndarray) -> list[Box]:
    return [mask_box(part) for part in separate_parts(mask)] if mask.any() else []


def _working(light: np.ndarray, hints: Hints) -> tuple[np.ndarray, Hints]:
    """The photo and the hints at the size that is worked on."""
    height, width = light.shape[:2]
    factor = min(1.0, WORKING / max(height, width))
    size = max(round(height * factor), 1), max(round(width * factor), 1)
    down, across = size[0] / height, size[1] / width

    def moved(points: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
        return tuple((int((x + 0.5) * across), int((y + 0.5) * down)) for x, y in points)

    box = None
    if hints.box is not None:
        left, top, wide, high = hints.box
        first = int(left * across), int(top * down)
        last = int(np.ceil((left + wide) * across)), int(np.ceil((top + high) * down))
        box = (*first, last[0] - first[0], last[1] - first[1])
    return resampled(light, size), Hints(moved(hints.points), moved(hints.others), box)


def _all_of(light: np.ndarray) -> Part:
    return Part(0, 0, light.shape[1], light.shape[0])


def _at_size(found: FoundMask, shape: tuple[int, ...]) -> FoundMask:
    cover = resampled(found.cover, (shape[0], shape[1]))
    return replace(found, cover=np.clip(cover, 0, 1))


def _second_look(
    light: np.ndarray, first: PartPrediction, hints: Hints, network: MaskNetwork | None
) -> FoundMask:
    """Run the second pass on what the first pass found, and refine its outline."""
    inside = _meant(first.cover, hints)
    weights = (network or MaskNetwork.shipped()).confidence_weights
    if not inside.any():
        return FoundMask(np.zeros_like(first.cover), 0.0, first.counts, no_evidence(first))
    part = _around(mask_box(inside), light.shape)
    second = _averaged([predict_part(light, part, hints, network, side) for side in _SIDES])
    known = _known(hints, part, second.cover.shape)
    cover = np.zeros_like(first.cover)
    cover[part.slices] = refined(light[part.slices], second.cover, known)
    if hints.box is not None:
        if not hints.points and (second.cover > 0.5).sum() < _SEEN * (cover >= 0.5).sum():
            cover[:] = 0
        outside = np.ones(cover.shape, bool)
        left, top, wide, high = hints.box
        outside[top : top + high, left : left + wide] = False
        cover[outside] = 0
    evidence = evidence_of(first, second, first.cover[part.slices])
    return FoundMask(cover, confidence_of(evidence, weights), first.counts, evidence)


def _averaged(looks: list[PartPrediction]) -> PartPrediction:
    cover, counts = (
        np.mean([getattr(one, name) for one in looks], axis=0) for name in ("cover", "counts")
    )
    return PartPrediction(cover, counts)


def _meant(cover: np.ndarray, hints: Hints) -> np.ndarray:
    """The pixels of what is meant: the parts that hold points, or the largest ones."""
    mask = cover > 0.5
    if not mask.any():
        return mask
    parts = separate_parts(tidy_mask(mask))
    pointed = [part for part in parts if any(part[y, x] for x, y in hints.points)]
    return np.asarray(np.any(pointed or parts, axis=0))


def _around(box: Box, shape: tuple[int, ...]) -> Part:
    """A box with a margin, inside of the photo."""
    x, y, width, height = box
    margin = int(np.ceil(_MARGIN * max(width, height)))
    left, top = max(x - margin, 0), max(y - margin, 0)
    right, bottom = min(x + width + margin, shape[1]), min(y + height + margin, shape[0])
    return Part(left, top, right - left, bottom - top)


def _known(hints: Hints, part: Part, shape: tuple[int, ...]) -> np.ndarray:
    """What the user says of the pixels of a part; see `refined`."""
    known = np.zeros(shape, np.int8)
    radius = max(max(shape) // 100, 1)
    for value, points in ((1, hints.points), (-1, hints.others)):
        for x, y in points:
            row, column = y - part.top, x - part.left
            if 0 <= row < shape[0] and 0 <= column < shape[1]:
                known[
                    max(row - radius, 0) : row + radius + 1,
                    max(column - radius, 0) : column + radius + 1,
                ] = value
    return known
