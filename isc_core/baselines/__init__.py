"""Simple decompositions that SIRFS is compared with: one method a file, and one function that knows
their names.
"""

import numpy as np

from ..errors import InputError
from . import ikeuchi_horn_1981, naive, retinex, tsai_shah_1994
from .estimate import BaselineEstimate

METHODS = ("naive", "retinex", "sfs-tsai-shah", "sfs-ikeuchi-horn")


def estimate(method: str, log_image: np.ndarray, mask: np.ndarray) -> BaselineEstimate:
    """Shape, shading and light by the named method's defaults.

    `log_image` (H, W, 3) natural logarithm of a linear diffuse image, finite in the `mask` (H, W)
    bool. Raises `InputError` for a name that is not one of `METHODS`, and for arrays that do not
    fit.
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
