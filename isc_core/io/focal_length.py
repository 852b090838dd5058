"""Focal lengths: millimetres on 35-mm film, and pixels. Without slow imports."""

import math
from dataclasses import dataclass

SHORTEST_35MM, LONGEST_35MM = 8.0, 3000.0
"""Equivalent focal lengths in millimetres: a fisheye, a telescope."""
_DIAGONAL_35MM = math.hypot(36, 24)


@dataclass(frozen=True)
class FocalLength:
    """The focal length in the metadata of a photo.

    Attributes
    ----------
    pixels : float
        Focal length in pixels of the photo.
    cropped : bool
        Whether the metadata state another aspect ratio: the photo was cropped, and the focal length
        is invalid.
    """

    pixels: float
    cropped: bool = False


def pixels_of_35mm(millimetres: float, size: tuple[int, int]) -> float:
    """Convert a 35-mm equivalent focal length.

    Parameters
    ----------
    millimetres : float
        Focal length with the same diagonal angle of view on a frame of 36 x 24 mm, as in EXIF.
    size : tuple of int
        Width and height of the photo in pixels.

    Returns
    -------
    float
        Pixels.
    """
    return millimetres / _DIAGONAL_35MM * math.hypot(*size)
