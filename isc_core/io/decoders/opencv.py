"""Images of 16 bits per channel and floats, decoded by OpenCV."""

import cv2
import numpy as np


def decode_opencv(data: bytes) -> np.ndarray:
    """Decode an image with its bits and values as stored, channels in RGB(A) order.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    (H, W) or (H, W, C) ndarray

    Raises
    ------
    ValueError
        If OpenCV cannot decode it.
    """
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("not decoded")
    if pixels.ndim == 2:
        return pixels
    return pixels[..., [2, 1, 0, 3][: pixels.shape[2]]]
