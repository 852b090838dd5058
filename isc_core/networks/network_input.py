"""The input of every network: the object's box at a fixed size, padded to the network's stride."""

from dataclasses import dataclass

import numpy as np

from ..imaging.area_resize import averaged_object
from .layers import pad_to_stride


@dataclass(frozen=True)
class NetworkInput:
    """A photo in the networks' input format.

    Attributes
    ----------
    image : (rows, columns, 3) float32 ndarray
        Light over the object's mean light, 0 outside the object; sides are multiples of the stride.
    mask : (rows, columns) bool ndarray
    place : tuple of slice
        Rows and columns of the downscaled object in `image`.
    inside : (h, w) bool ndarray
        Mask of the downscaled object.
    factor : float
        Size of the downscaled object over that of the photo's.
    """

    image: np.ndarray
    mask: np.ndarray
    place: tuple[slice, slice]
    inside: np.ndarray
    factor: float


def standardise_input(image: np.ndarray, mask: np.ndarray, long_side: int) -> NetworkInput:
    """Bring a photo to the size and format that the networks expect.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear light, not negative inside the mask.
    mask : (H, W) bool ndarray
    long_side : int
        Of the object, in pixels.

    Returns
    -------
    NetworkInput
    """
    small, inside, factor = averaged_object(image, mask, long_side)
    (light, cover), place = pad_to_stride(small, inside)
    return NetworkInput(light, cover, place, inside, factor)
