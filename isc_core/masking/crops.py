"""Crops of a photo in the network's frame, and the way back.

Problem: the network sees a square frame of fixed size; a photo has any size and shape.

Equation: a crop is downsampled by averaging, or upsampled, to fill the longer side of the frame,
and placed at its centre. Hints are transformed likewise. The predicted coverage is resampled to the
pixels of the crop.

Limits: the aspect ratio changes by the rounding of the shorter side to even pixels.
"""

from dataclasses import dataclass

import numpy as np

from ..imaging.resampling import resampled
from ..networks.mask_network import POINT_RADIUS, SIDE, MaskNetwork, predict_mask
from ..photo.grabcut import Box
from .hints import Hints

MARGIN = 0.25  # around a box, of its longer side


@dataclass(frozen=True)
class Crop:
    """A rectangle inside a photo.

    Attributes
    ----------
    left, top, width, height : int
        Pixels.
    """

    left: int
    top: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns."""
        return (
            slice(self.top, self.top + self.height),
            slice(self.left, self.left + self.width),
        )


def with_margin(box: Box, shape: tuple[int, ...]) -> Crop:
    """Return a box with the margin that the second pass and the refinement need.

    Parameters
    ----------
    box : tuple of int
        (x, y, width, height).
    shape : tuple of int
        Rows and columns of the photo, first of all.

    Returns
    -------
    Crop
        Clipped to the photo.
    """
    x, y, width, height = box
    margin = int(np.ceil(MARGIN * max(width, height)))
    left, top = max(x - margin, 0), max(y - margin, 0)
    right, bottom = min(x + width + margin, shape[1]), min(y + height + margin, shape[0])
    return Crop(left, top, right - left, bottom - top)


def cut_to_box(cover: np.ndarray, box: Box) -> np.ndarray:
    """Return coverage that is 0 outside a box.

    Parameters
    ----------
    cover : (H, W) ndarray
    box : tuple of int
        (x, y, width, height).

    Returns
    -------
    (H, W) ndarray
    """
    left, top, width, height = box
    inside = slice(top, top + height), slice(left, left + width)
    cut = np.zeros_like(cover)
    cut[inside] = cover[inside]
    return cut


@dataclass(frozen=True, eq=False)
class CropPrediction:
    """The network's prediction for a crop of a photo.

    Attributes
    ----------
    cover : (height, width) float32 ndarray
        Probability of the object at each pixel of the crop.
    counts : (3,) ndarray
        Probabilities of no, one and several objects.
    """

    cover: np.ndarray
    counts: np.ndarray


def predict_crop(
    light: np.ndarray, crop: Crop, hints: Hints, network: MaskNetwork, side: int = SIDE
) -> CropPrediction:
    """Predict the mask of a crop.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
        Linear; the whole photo.
    crop : Crop
    hints : Hints
        In pixels of `light`; those outside the crop have no effect.
    network : MaskNetwork
    side : int
        Side of the frame, pixels, a multiple of 32.

    Returns
    -------
    CropPrediction
    """
    width, height = size_in_frame((crop.width, crop.height), side)
    left, top = (side - width) // 2, (side - height) // 2
    place = slice(top, top + height), slice(left, left + width)
    small, frame = np.zeros((side, side, 3), np.float32), np.zeros((side, side), bool)
    small[place], frame[place] = resampled(light[crop.slices], (height, width)), True
    scale = width / crop.width, height / crop.height
    maps = _hint_maps(hints, crop, scale, (left, top), side)
    found = predict_mask(small, frame, maps, network)
    cover = resampled(found.cover[place], (crop.height, crop.width))
    return CropPrediction(cover.clip(0, 1), found.counts)


def size_in_frame(size: tuple[int, int], side: int) -> tuple[int, int]:
    """Return the size of a crop in the frame.

    Parameters
    ----------
    size : tuple of int
        Of the crop, pixels; in any order.
    side : int
        Of the frame, pixels.

    Returns
    -------
    tuple of int
        Even numbers, which are symmetric about the centre: a mirrored photo gives mirrored input.
    """
    factor = side / max(size)
    first, second = (min(max(2 * round(n * factor / 2), 2), side) for n in size)
    return first, second


def _hint_maps(
    hints: Hints, crop: Crop, scale: tuple[float, float], origin: tuple[int, int], side: int
) -> np.ndarray:
    """The channels (side, side, 3) of the hints; `origin` is the crop's place in the frame."""
    maps = np.zeros((side, side, 3), np.float32)
    rows, columns = np.indices((side, side))

    def in_frame(x: float, y: float) -> tuple[float, float]:
        return (
            (x - crop.left) * scale[0] + origin[0],
            (y - crop.top) * scale[1] + origin[1],
        )

    for channel, points in enumerate((hints.points, hints.background)):
        for x, y in points:
            across, down = in_frame(x + 0.5, y + 0.5)
            squared = (columns + 0.5 - across) ** 2 + (rows + 0.5 - down) ** 2
            maps[squared <= POINT_RADIUS**2, channel] = 1
    if hints.box is not None:
        x, y, width, height = hints.box
        (left, top), (right, bottom) = in_frame(x, y), in_frame(x + width, y + height)
        inside = (columns + 0.5 > left) & (columns + 0.5 < right)
        maps[inside & (rows + 0.5 > top) & (rows + 0.5 < bottom), 2] = 1
    return maps
