"""Splitting a photo into diffuse and specular: one method a file, and one function that knows their names."""

import numpy as np

from ..decomposition import Separation
from ..errors import InputError
from . import none, shen_2013
from .checks import check_arrays

METHODS = ("none", "shen_2013")


def separate(method: str, image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None) -> Separation:
    """Splits `image` (H, W, 3), linear, under white light, inside `mask` (H, W) bool, by the named method's defaults.

    `clipped` (H, W) bool marks pixels whose true value lies above the recorded one. Raises `InputError` for a name that is not
    one of `METHODS`, and for arrays that do not fit.
    """
    if method not in METHODS:
        raise InputError(f"unknown separation method {method!r}: choose one of {', '.join(METHODS)}")
    check_arrays(image, mask, clipped)
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    if len(rows) == 0:
        return none.separate(image, mask, clipped)
    # The object's box alone, so that space around it changes nothing.
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    inside = image[part], mask[part], None if clipped is None else clipped[part]
    split = none.separate(*inside) if method == "none" else shen_2013.separate(inside[0], inside[1], clipped=inside[2])
    return Separation(*(_placed(layer, part, mask.shape) for layer in (split.diffuse, split.specular, split.residual, split.confidence)))


def _placed(layer: np.ndarray, part: tuple[slice, slice], shape: tuple[int, ...]) -> np.ndarray:
    whole = np.zeros((*shape, *layer.shape[2:]), layer.dtype)
    whole[part] = layer
    return whole
