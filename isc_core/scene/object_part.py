"""The part of a photo around its object, for results that cover the whole frame.

Problem: the object of a photo by a phone often covers a tenth of the frame. Every stage would
process the background, too: with an object of .6 megapixels in a frame of 12, that took three
times as long, and twice the memory.

Method: cut out the object with a margin, decompose that, and place the maps in the frame. The
pixels of downscaled maps begin at the frame's upper left corner, so the part must begin where one
of them does, to 1/50 of its side. Therefore its corner is moved by up to 64 pixels, and the object
becomes up to a percent smaller.

Limits: a part that saves less than half of the frame is not worth the change of the grids on which
stages average blocks of pixels, which changes the last digits.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..imaging.area_resize import reduced_count
from ..imaging.bounding_box import WORTHWHILE, FramePart, aligned_edge, mask_slices, misalignment
from ..photo import Photo
from .decomposition import Decomposition
from .known_inputs import KnownInputs
from .part_of_result import placed_result

_MARGIN, _LEAST_MARGIN = 0.125, 32  # of the object's long side; pixels of the photo
_SEARCH = 64  # pixels of the photo
_EXACT = 0.02  # pixels of the maps
_ATTEMPTS = 3
_FACTORS, _SMALLER = 40, 0.25  # factors to try; pixels of the photo by which the object shrinks


@dataclass(frozen=True)
class ObjectPart:
    """The part of a photo that is decomposed.

    Attributes
    ----------
    photo, maps : Photo
        The part, at the photo's size and at that of the maps.
    source : FramePart
        Its place in the photo.
    target : FramePart
        The place of its maps in those of the whole photo.
    """

    photo: Photo
    maps: Photo
    source: FramePart
    target: FramePart

    def known(self, inputs: KnownInputs) -> KnownInputs:
        """Return the known quantities of the part.

        Parameters
        ----------
        inputs : KnownInputs
            Of the whole photo.

        Returns
        -------
        KnownInputs
        """
        if self.source.is_whole:
            return inputs
        height, depth = (
            None if values is None else self.source.cut(values)
            for values in (inputs.height, inputs.depth)
        )
        return replace(inputs, height=height, depth=depth)

    def placed(self, result: Decomposition) -> Decomposition:
        """Return a result of the part as one of the whole photo.

        Parameters
        ----------
        result : Decomposition

        Returns
        -------
        Decomposition
        """
        return placed_result(result, self.target)


def object_part(photo: Photo, maps_size: int) -> ObjectPart:
    """Cut out the object of a photo if that saves half of the frame, and resize it.

    Parameters
    ----------
    photo : Photo
    maps_size : int
        Long side of the object in the maps; 0 for the photo's.

    Returns
    -------
    ObjectPart

    Raises
    ------
    InputError
        If `maps_size` leaves the object too thin.
    """
    longest = max(photo.box[2:])
    factor = min(1.0, maps_size / longest) if maps_size > 0 else 1.0
    for _ in range(_ATTEMPTS):
        source, factor = _around(photo.mask, longest, factor)
        if source.share > WORTHWHILE:
            break
        part = photo.cut(source)
        maps = part.resized_to_object(maps_size, factor)
        factor = maps.scale / photo.scale  # smaller if the resized mask would be too long
        if all(misalignment(start, factor) <= _EXACT for start in source.corner):
            return ObjectPart(part, maps, source, _in_maps(source, maps, factor))
    maps = photo.resized_to_object(maps_size)
    return ObjectPart(photo, maps, *(FramePart.whole(_shape(one.mask)) for one in (photo, maps)))


def _around(mask: np.ndarray, longest: int, factor: float) -> tuple[FramePart, float]:
    """The object with a margin, whose corner is where a pixel of the maps begins, or nearly so; and
    the largest factor of the maps for which there is one.
    """
    margin = max(_LEAST_MARGIN, round(_MARGIN * longest))
    boxes = mask_slices(mask, margin)
    for _ in range(_FACTORS if factor < 1 else 1):
        rows, columns = (slice(_aligned(box.start, factor), box.stop) for box in boxes)
        if max(misalignment(one.start, factor) for one in (rows, columns)) <= _EXACT:
            break
        factor *= 1 - _SMALLER / longest
    return FramePart(rows, columns, _shape(mask)), factor


def _shape(mask: np.ndarray) -> tuple[int, int]:
    return mask.shape[0], mask.shape[1]


def _aligned(start: int, factor: float) -> int:
    """The pixel, at most `_SEARCH` before `start`, nearest to the beginning of one of the maps."""
    return aligned_edge(range(start, max(start - _SEARCH, -1), -1), factor)


def _in_maps(source: FramePart, maps: Photo, factor: float) -> FramePart:
    """The place of the part's maps in those of the whole photo."""
    height, width = (reduced_count(count, factor) for count in source.shape)
    left, top = (round(start * factor) for start in source.corner)
    rows, columns = maps.mask.shape
    bottom, right = min(top + rows, height), min(left + columns, width)
    return FramePart(slice(top, bottom), slice(left, right), (height, width))
