"""Simple decompositions to compare SIRFS with: one method a file, and `estimate`, which selects
one by name.
"""

import numpy as np

from ..errors import InputError
from . import ikeuchi_horn_1981, naive, retinex, tsai_shah_1994
from .estimate import BaselineEstimate

METHODS = ("naive", "retinex", "sfs-tsai-shah", "sfs-ikeuchi-horn")


def estimate(method: str, log_image: np.ndarray, mask: np.ndarray) -> BaselineEstimate:
    """Estimate shape, shading and light by a method's defaults.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    log_image : (H, W, 3) ndarray
        Natural logarithm of a linear diffuse image, finite in the mask.
    mask : (H, W) bool ndarray

    Returns
    -------
    BaselineEstimate

    Raises
    ------
    InputError
        For an unknown method, and for arrays that do not fit.
    """
    match method:
        case "naive":
            return naive.estimate(log_image, mask)
        case "retinex":
            return retinex.estimate(log_image, mask)
        case "sfs-tsai-shah":
            return tsai_shah_1994.estimate(log_image, mask)
        case "sfs-ikeuchi-horn":
            return ikeuchi_horn_1981.estimate(log_image, mask)
    raise InputError(f"unknown model {method!r}: choose one of {', '.join(METHODS)}")
