"""The mask of the object in a photo.

Problem: a photo without a mask, an alpha channel or a plain border shows an object in front of
something else.

Equation: the first pass of the network (`networks.mask_network`) uses the whole photo, the second
pass a crop around the result, in which the object is larger. The second pass averages two
predictions, in frames of 96 and of 128 pixels, because their errors differ. `confidence` gives the
confidence of the mask, and `refinement` brings it to the photo's own pixels.

Citation: see `networks.mask_network` and `refinement`; an object reaches the sides of its box: V.
Lempitsky et al. 2009, doi:10.1109/ICCV.2009.5459262. Where the network's mask does not, the box is
segmented by colours alone (`photo.grabcut`). Points correct the mask (`corrections`).

Limits: measured in docs/methods/automatic_mask.md.
"""

from dataclasses import replace

import numpy as np

from ..imaging.bounding_box import mask_box
from ..imaging.resampling import resampled
from ..networks.mask_network import Count, MaskNetwork
from ..photo.found_mask import FoundMask
from ..photo.grabcut import Box, grabcut
from ..photo.masks import tidy_mask
from .components import connected_components, is_one_piece
from .confidence import (
    confidence_features,
    confidence_of,
    features_of_replacement,
    features_without_object,
)
from .corrections import agreement, corrected, marked_pixels
from .crops import Crop, CropPrediction, cut_to_box, predict_crop, with_margin
from .hints import Hints
from .refinement import refined
from .refusal import refusal_reason

WORKING = 768  # pixels of the longer side of the photo at the working size
_SIDES = (96, 128)  # sides of the network's frame in the second pass, pixels
_PRIOR_SHIFT = 0.5  # of the log odds; chosen on photos by people. A box gives the size
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
    if hints.points or hints.background:
        return _with_points(light, hints, network)
    small, scaled = _at_working_size(light, hints)
    found = _upsampled(_both_passes(small, scaled, network), light.shape, hints.box)
    if hints.box is None or _fills_box(found.mask, hints.box):
        return found
    cover = grabcut(light, hints.box).astype(np.float32)
    features = features_of_replacement(found.features, found.cover, cover)
    confidence = confidence_of(features, network.confidence_weights)
    return replace(found, cover=cover, features=features, confidence=confidence)


def _with_points(light: np.ndarray, hints: Hints, network: MaskNetwork) -> FoundMask:
    """Find the mask without the points, and correct it by them. It stays if it would be used and
    all points agree: then the network is not run again.
    """
    small, scaled = _at_working_size(light, hints)
    found = _both_passes(small, Hints(box=scaled.box), network)
    if scaled.box is None:
        usable = not refusal_reason(found)
    else:
        usable = _fills_box(found.mask, scaled.box)
    if not usable or agreement(found.mask, scaled) < 1:
        hinted = _both_passes(small, scaled, network) if hints.points else found
        found = corrected(small, found, hinted, scaled, usable=usable)
    return _upsampled(found, light.shape, hints.box)


def _both_passes(small: np.ndarray, hints: Hints, network: MaskNetwork) -> FoundMask:
    """The mask at the working size."""
    return _second_pass(small, predict_crop(small, _whole(small), hints, network), hints, network)


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


def _upsampled(found: FoundMask, shape: tuple[int, ...], box: Box | None = None) -> FoundMask:
    """At the photo's size, where nothing outside the box belongs to the object."""
    cover = resampled(found.cover, (shape[0], shape[1]))
    np.clip(cover, 0, 1, out=cover)
    return replace(found, cover=cover if box is None else cut_to_box(cover, box))


def _second_pass(
    light: np.ndarray, first: CropPrediction, hints: Hints, network: MaskNetwork
) -> FoundMask:
    """Run the second pass around the result of the first, and refine its outline."""
    inside = _intended(first.cover, hints)
    if not inside.any():
        return FoundMask(
            np.zeros_like(first.cover), 0.0, first.counts, features_without_object(first)
        )
    crop = with_margin(mask_box(inside), light.shape)
    second = _mean_prediction([predict_crop(light, crop, hints, network, n) for n in _SIDES])
    cover = np.zeros_like(first.cover)
    shift = _PRIOR_SHIFT if hints.box is None else 0.0
    marked = marked_pixels(hints, crop)
    cover[crop.slices] = refined(light[crop.slices], second.cover, marked, shift)
    if hints.box is not None:
        spread = (second.cover > 0.5).sum() < _MIN_PREDICTED * (cover >= 0.5).sum()
        cover = (
            np.zeros_like(cover) if spread and not hints.points else cut_to_box(cover, hints.box)
        )
    whole = is_one_piece(first.cover > 0.5) and is_one_piece(cover >= 0.5)
    features = confidence_features(first, second, first.cover[crop.slices], whole)
    confidence = confidence_of(features, network.confidence_weights)
    return FoundMask(cover, confidence, first.counts, features)


def _mean_prediction(predictions: list[CropPrediction]) -> CropPrediction:
    cover, counts = (
        np.mean([getattr(one, name) for one in predictions], axis=0) for name in ("cover", "counts")
    )
    return CropPrediction(cover, counts)


def _intended(cover: np.ndarray, hints: Hints) -> np.ndarray:
    """The pixels that the second pass must see: all points and the components that contain them;
    without such, the large ones.
    """
    mask = cover > 0.5
    if not mask.any():
        return mask
    components = connected_components(tidy_mask(mask))
    pointed = [one for one in components if any(one[y, x] for x, y in hints.points)]
    intended = np.asarray(np.any(pointed or components, axis=0))
    for x, y in hints.points:
        intended[y, x] = True
    return intended
