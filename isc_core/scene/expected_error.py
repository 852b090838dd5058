"""Expected errors of a result: maps in stated units."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class ExpectedError:
    """Expected errors of a result at each pixel.

    Attributes
    ----------
    normal : (H, W) ndarray of float32
        Expected angle between recovered and true normal, degrees, in [0, 180]; 0 outside the mask.
    reflectance : (H, W) ndarray of float32
        Expected absolute error of the natural logarithm of a channel's reflectance, one factor of
        the whole image aside: .1 is about 10 %. 0 outside the mask.
    """

    normal: np.ndarray
    reflectance: np.ndarray
