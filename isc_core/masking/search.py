"""The mask of the object in a photo.

Problem: a photo without a mask, an alpha channel or a plain border shows an object in front of
something else.

Equation: the first pass of the network (`networks.mask_network`) uses the whole photo, the second
pass a crop around the result, in which the object is larger. The second pass averages two
predictions, in frames of 96 and of 128 pixels, because their errors differ. `confidence` gives the
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
from .confidence import (
    confidence_features,
    confidence_of,
    features_of_replacement,
    features_without_object,
)
from .crops import Crop, CropPrediction, predict_crop
from .hints import Hints
from .refinement import refined

WORKING = 768  # pixels of the longer side of the photo at the working size
_SIDES = (96, 128)  # sides of the network's frame in the second pass, pixels
_MARGIN = 0.25  # around the object in the second pass, of its longer side
_MIN_BOX_FILL = 0.75  # of the sides of a box: a smaller mask is not what the box was drawn around
_MIN_PREDICTED = 0.5  # of a mask in a box: GrabCut alone spreads among similar colours
_MAX_NO_OBJECT = 0.5  # probability of no object above which none is searched for


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
        That of the mirrored photo is mirrored.
    """
    hints, network = hints or Hints(), network or MaskNetwork.shipped()
    small, scaled = _at_working_size(light, hints)
    first = predict_crop(small, _whole(small), scaled, network)
    found = _upsampled(_second_pass(small, first, scaled, network), light.shape)
    if hints.box is None or hints.points or _fills_box(found.mask, hints.box):
        return replace(found, confidence=found.confidence * _satisfied(found.mask, hints))
    cover = grabcut(light, hints.box).astype(np.float32)
    features = features_of_replacement(found.features, found.cover, cover)
    confidence = confidence_of(features, network.confidence_weights)
    return replace(found, cover=cover, features=features, confidence=confidence)


def _satisfied(mask: np.ndarray, hints: Hints) -> float:
    """The fraction of points that a mask satisfies; 1 without points."""
    satisfied = [bool(mask[y, x]) for x, y in hints.points]
    satisfied += [not mask[y, x] for x, y in hints.background]
    return sum(satisfied) / len(satisfied) if satisfied else 1.0


def _fills_box(mask: np.ndarray, box: Box) -> bool:
    """Whether a mask is about as wide and as high as the box that was drawn around the object."""
    if not mask.any():
        return False
    width, height = mask_box(mask)[2:]
    return width >= _MIN_BOX_FILL * box[2] and height >= _MIN_BOX_FILL * box[3]


def find_masks(light: np.ndarray, network: MaskNetwork | None = None) -> list[FoundMask]:
    """Find each of several separate objects in a photo.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
        As for `find_mask`.
    network : MaskNetwork, optional
        By default the shipped one.

    Returns
    -------
    list of FoundMask
        From left to right; objects that do not touch. Empty if there is none.
    """
    network = network or MaskNetwork.shipped()
    small, hints = _at_working_size(light, Hints())
    first = predict_crop(small, _whole(small), hints, network)
    if first.counts[Count.NONE] > _MAX_NO_OBJECT:
        return []
    together = _second_pass(small, first, hints, network).mask
    if not together.any():
        return []
    found = []
    for component in connected_components(together):
        hints = Hints(box=mask_box(component))
        first = predict_crop(small, _whole(small), hints, network)
        if (first.cover > 0.5).any():
            found.append(_upsampled(_second_pass(small, first, hints, network), light.shape))
    return found


def connected_components(mask: np.ndarray, share: float = 0.1) -> list[np.ndarray]:
    """Return the connected components of a mask (8 neighbours), without small ones.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    share : float
        Minimum area of a component, relative to that of the largest.

    Returns
    -------
    list of (H, W) bool ndarray
        From left to right.
    """
    labels, _ = ndimage.label(mask, np.ones((3, 3)))
    areas = np.bincount(labels.ravel())
    areas[0] = 0
    chosen = np.flatnonzero(areas >= max(share * areas.max(), 1))
    components = [labels == number for number in chosen]
    return sorted(components, key=lambda component: mask_box(component)[:2])


def _at_working_size(light: np.ndarray, hints: Hints) -> tuple[np.ndarray, Hints]:
    """The photo, downsampled to at most WORKING pixels, and the hints in its pixels."""
    height, width = light.shape[:2]
    factor = min(1.0, WORKING / max(height, width))
    size = max(round(height * factor), 1), max(round(width * factor), 1)
    down, across = size[0] / height, size[1] / width

    def scaled(points: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
        return tuple((int((x + 0.5) * across), int((y + 0.5) * down)) for x, y in points)

    box = None
    if hints.box is not None:
        left, top, wide, high = hints.box
        first = int(left * across), int(top * down)
        last = int(np.ceil((left + wide) * across)), int(np.ceil((top + high) * down))
        box = (*first, last[0] - first[0], last[1] - first[1])
    return resampled(light, size), Hints(scaled(hints.points), scaled(hints.background), box)


def _whole(light: np.ndarray) -> Crop:
    return Crop(0, 0, light.shape[1], light.shape[0])


def _upsampled(found: FoundMask, shape: tuple[int, ...]) -> FoundMask:
    cover = resampled(found.cover, (shape[0], shape[1]))
    return replace(found, cover=np.clip(cover, 0, 1))


def _second_pass(
    light: np.ndarray, first: CropPrediction, hints: Hints, network: MaskNetwork
) -> FoundMask:
    """Run the second pass around the result of the first, and refine its outline."""
    inside = _intended(first.cover, hints)
    if not inside.any():
        return FoundMask(
            np.zeros_like(first.cover), 0.0, first.counts, features_without_object(first)
        )
    crop = _with_margin(mask_box(inside), light.shape)
    second = _mean_prediction([predict_crop(light, crop, hints, network, n) for n in _SIDES])
    known = _marked_pixels(hints, crop, second.cover.shape)
    cover = np.zeros_like(first.cover)
    cover[crop.slices] = refined(light[crop.slices], second.cover, known)
    if hints.box is not None:
        spread = (second.cover > 0.5).sum() < _MIN_PREDICTED * (cover >= 0.5).sum()
        cover = np.zeros_like(cover) if spread and not hints.points else _cut(cover, hints.box)
    whole = _is_one_piece(first.cover > 0.5) and _is_one_piece(cover >= 0.5)
    features = confidence_features(first, second, first.cover[crop.slices], whole)
    confidence = confidence_of(features, network.confidence_weights)
    return FoundMask(cover, confidence, first.counts, features)


def _is_one_piece(mask: np.ndarray) -> bool:
    """Whether a mask has one component; small ones do not count."""
    return bool(mask.any()) and len(connected_components(mask)) == 1


def _cut(cover: np.ndarray, box: Box) -> np.ndarray:
    """Coverage, set to 0 outside a box."""
    left, top, width, height = box
    inside = slice(top, top + height), slice(left, left + width)
    cut = np.zeros_like(cover)
    cut[inside] = cover[inside]
    return cut


def _mean_prediction(predictions: list[CropPrediction]) -> CropPrediction:
    cover, counts = (
        np.mean([getattr(one, name) for one in predictions], axis=0) for name in ("cover", "counts")
    )
    return CropPrediction(cover, counts)


def _intended(cover: np.ndarray, hints: Hints) -> np.ndarray:
    """The mask of the target: the components that contain points; without such, the large ones."""
    mask = cover > 0.5
    if not mask.any():
        return mask
    components = connected_components(tidy_mask(mask))
    pointed = [one for one in components if any(one[y, x] for x, y in hints.points)]
    return np.asarray(np.any(pointed or components, axis=0))


def _with_margin(box: Box, shape: tuple[int, ...]) -> Crop:
    """A box with a margin, clipped to the photo."""
    x, y, width, height = box
    margin = int(np.ceil(_MARGIN * max(width, height)))
    left, top = max(x - margin, 0), max(y - margin, 0)
    right, bottom = min(x + width + margin, shape[1]), min(y + height + margin, shape[0])
    return Crop(left, top, right - left, bottom - top)


def _marked_pixels(hints: Hints, crop: Crop, shape: tuple[int, ...]) -> np.ndarray:
    """The pixels of a crop that the user has marked; see `refined`."""
    known = np.zeros(shape, np.int8)
    radius = max(max(shape) // 100, 1)
    for value, points in ((1, hints.points), (-1, hints.background)):
        for x, y in points:
            row, column = y - crop.top, x - crop.left
            if 0 <= row < shape[0] and 0 <= column < shape[1]:
                known[
                    max(row - radius, 0) : row + radius + 1,
                    max(column - radius, 0) : column + radius + 1,
                ] = value
    return known
