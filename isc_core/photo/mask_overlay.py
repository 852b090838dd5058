"""A small picture of a photo with its mask as an overlay, to check the mask.

The background is darkened and tinted red, the mask's outline is orange.

Limits: at most 256 pixels wide or high, so thin parts of a mask are hard to see.
"""

from pathlib import Path

import numpy as np
from PIL import Image

from ..imaging.area_resize import AreaFilter
from ..imaging.luminance import white_of
from ..imaging.srgb import linear_to_srgb
from ..io.atomic import new_file
from .photo import Photo

_SIZE = 256
_TINT, _TINT_SHARE = np.array([0.45, 0.05, 0.05]), 0.6
_OUTLINE = np.array([1.0, 0.55, 0.1])


def mask_overlay(image: np.ndarray, mask: np.ndarray, white: float = 1.0) -> np.ndarray:
    """Return the picture.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Photo, linear Rec.709.
    mask : (H, W) bool ndarray
    white : float
        The light that is shown as white, > 0.

    Returns
    -------
    (h, w, 3) uint8 ndarray
        sRGB codes; neither side is longer than 256 pixels.
    """
    area = AreaFilter.of(mask.shape, min(1.0, _SIZE / max(mask.shape)))
    planes = [area(np.clip(image[..., k] / white, 0, 1)) / area.full for k in range(3)]
    small = np.dstack(planes)
    coded, inside = linear_to_srgb(small), area(mask) >= 0.5 * area.full
    shown = np.where(inside[..., None], coded, (1 - _TINT_SHARE) * coded + _TINT_SHARE * _TINT)
    shown[_outline(inside)] = _OUTLINE
    codes: np.ndarray = np.rint(255 * shown).astype(np.uint8)
    return codes


def write_mask_overlay(path: Path, photo: Photo) -> None:
    """Write the picture of a photo as a PNG, completely or not at all.

    Parameters
    ----------
    path : Path
    photo : Photo
        Floats have no white of their own: the object's is used.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    white = 1.0 if photo.exposed else white_of(photo.image, photo.mask)
    with new_file(path) as partial:
        Image.fromarray(mask_overlay(photo.image, photo.mask, white)).save(partial, format="PNG")


def _outline(inside: np.ndarray) -> np.ndarray:
    """Pixels of the object next to the background."""
    padded = np.pad(inside, 1, mode="edge")
    neighbours = (padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:])
    outline: np.ndarray = inside & ~np.logical_and.reduce(neighbours)
    return outline
