"""The input frame of a network, and the transformation of its output to the photo.

The object's bounding box is downsampled to a fixed length by averaging, and placed at the centre of
a square; smaller objects are not resampled. Maps of the frame are upsampled to the photo's pixels.
"""

from dataclasses import dataclass

import numpy as np

from ..filters.distance import nearest_pixels
from ..imaging.area_resize import averaged_object
from ..imaging.bounding_box import mask_slices
from ..imaging.upsampling import enlarge_inside


@dataclass(frozen=True, eq=False)
class NetworkFrame:
    """The input of a network.

    Attributes
    ----------
    image : (side, side, 3) float32 ndarray
        Linear light, 0 outside the object.
    mask : (side, side) bool ndarray
    place : tuple of slice
        Rows and columns of the object's bounding box.
    factor : float
        Size of the object in the frame over that in the photo.
    """

    image: np.ndarray
    mask: np.ndarray
    place: tuple[slice, slice]
    factor: float


def framed(image: np.ndarray, mask: np.ndarray, side: int, long_side: int) -> NetworkFrame:
    """Place an object at the centre of a frame.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask.
    mask : (H, W) bool ndarray
    side : int
        Side of the frame, pixels.
    long_side : int
        Maximum length of the object, pixels, at most `side`.

    Returns
    -------
    NetworkFrame
    """
    small, inside, factor = averaged_object(image, mask, long_side)
    rows, columns = inside.shape
    top, left = (side - rows) // 2, (side - columns) // 2
    place = slice(top, top + rows), slice(left, left + columns)
    light, cover = np.zeros((side, side, 3), np.float32), np.zeros((side, side), bool)
    light[place], cover[place] = small, inside
    return NetworkFrame(light, cover, place, factor)


def at_full_size(maps: np.ndarray, frame: NetworkFrame, mask: np.ndarray) -> np.ndarray:
    """Upsample maps of the frame to the photo's pixels.

    Parameters
    ----------
    maps : (side, side, C) ndarray
        Valid on the object; they are extrapolated beyond it before upsampling.
    frame : NetworkFrame
    mask : (H, W) bool ndarray
        The object in the photo.

    Returns
    -------
    (H, W, C) float32 ndarray
        0 outside the mask.
    """
    box = mask_slices(mask)
    values, inside = maps[nearest_pixels(frame.mask)][frame.place], mask[box]
    full = np.zeros((*mask.shape, maps.shape[2]), np.float32)
    enlarge_inside(values, inside, 1 / frame.factor, full[box])
    return full
