"""A user's image as an albedo.

Limits: an image holds light, not reflectance: what is above `BRIGHTEST` becomes `BRIGHTEST`, each
channel on its own, before any reduction in size; nothing is scaled. Its left and right sides meet
in a seam unless the image itself goes around.
"""

from pathlib import Path

import cv2
import numpy as np

from isc_core.photo import read_linear

BRIGHTEST, LARGEST = 0.95, 4096


def image_albedo(path: str | Path, transfer: str = "auto") -> np.ndarray:
    """(h, w, 3) float32, linear Rec.709 in [0, .95]; transparency is ignored. `transfer`: "srgb",
    "linear", or "auto": floats are linear.

    A side above 4096 is reduced to that, by means over areas. Raises `InputError` where the file
    cannot be read.
    """
    linear = np.minimum(read_linear(path, transfer), np.float32(BRIGHTEST))
    height, width = linear.shape[:2]
    factor = LARGEST / max(height, width)
    if factor < 1:
        linear = cv2.resize(
            linear,
            (max(1, round(width * factor)), max(1, round(height * factor))),
            interpolation=cv2.INTER_AREA,
        )
    return np.ascontiguousarray(linear, np.float32)
