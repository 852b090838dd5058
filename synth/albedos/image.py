"""A user's image as an albedo.

Limits: an image contains light, not reflectance: values above `BRIGHTEST` are clipped to it, each
channel separately, before any reduction in size; nothing is scaled. Its left and right sides meet
in a seam unless the image is periodic.
"""

from pathlib import Path

import cv2
import numpy as np

from isc_core.photo import read_linear

BRIGHTEST, LARGEST = 0.95, 4096


def image_albedo(path: str | Path, transfer: str = "auto") -> np.ndarray:
    """Read an image as an albedo texture; transparency is ignored.

    Parameters
    ----------
    path : Path or str
        The image. A side above 4096 is reduced to that, by area averaging.
    transfer : str, optional
        "srgb", "linear", or "auto": floating-point images are linear.

    Returns
    -------
    (h, w, 3) ndarray of float32
        Linear Rec.709 in [0, .95].

    Raises
    ------
    InputError
        If the file cannot be read.
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
