"""The frame in which a network sees an object, and the way back to the photo.

The object's box is averaged down to a fixed length and placed in the middle of a square; smaller
objects stay as they are. Maps of the frame are enlarged to the photo's pixels.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..imaging.area_resize import averaged_object
from ..imaging.bounding_box import mask_slices
from ..imaging.upsampling import enlarge_inside


@dataclass(frozen=True)
class NetworkFrame:
    """A photo as the network sees it.

    Attributes
    ----------
    image : (side, side, 3) float32 ndarray
        Linear light, 0 outside the object.
    mask : (side, side) bool ndarray
    place : tuple of slice
        Rows and columns of the object's box.
    factor : float
        Size of the object over that in the photo.
    """

    image: np.ndarray
    mask: np.ndarray
    place: tuple[slice, slice]
    factor: float


def framed(image: np.ndarray, mask: np.ndarray, side: int, long_side: int) -> NetworkFrame:
    """Place an object in the middle of a frame.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask.
    mask : (H, W) bool ndarray
    side : int
        Of the frame, pixels.
    long_side : int
        Most pixels of the object, at most `side`.

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
    """Bring maps of the frame to the photo's pixels.

    Parameters
    ----------
    maps : (side, side, C) ndarray
        Valid on the object; its values are continued beyond it before they are enlarged.
    frame : NetworkFrame
    mask : (H, W) bool ndarray
        The photo's.

    Returns
    -------
    (H, W, C) float32 ndarray
        0 outside the mask.
    """
    box = mask_slices(mask)
    nearest = ndimage.distance_transform_edt(
        ~frame.mask, return_distances=False, return_indices=True
    )
    values, inside = maps[tuple(nearest)][frame.place], mask[box]
    full = np.zeros((*mask.shape, maps.shape[2]), np.float32)
    enlarge_inside(values, inside, 1 / frame.factor, full[box])
    return full
