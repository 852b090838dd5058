"""Splitting a photo into diffuse and specular: one method a file, and one function that knows their names."""

import numpy as np

from ..decomposition import Separation
from ..errors import InputError
from . import none, shen_2013

METHODS = ("none", "shen_2013")


def separate(method: str, image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None) -> Separation:
    """Splits `image` (H, W, 3), linear, under white light, inside `mask` (H, W) bool, by the named method's defaults.

    `clipped` (H, W) bool marks pixels whose true value lies above the recorded one. Raises `InputError` for a name that is not
    one of `METHODS`, and for arrays that do not fit.
    """
    match method:
        case "none":
            return none.separate(image, mask, clipped)
        case "shen_2013":
            return shen_2013.separate(image, mask, clipped=clipped)
    raise InputError(f"unknown separation method {method!r}: choose one of {', '.join(METHODS)}")
