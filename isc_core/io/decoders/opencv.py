"""Images of 16 bits a channel and floats, decoded by OpenCV."""

import cv2
import numpy as np


def decode_opencv(data: bytes) -> np.ndarray:
    """(H, W) or (H, W, C) in RGB(A) order, bits and values as stored.

    Raises ValueError where OpenCV gives nothing.
    """
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("not decoded")
    if pixels.ndim == 2:
        return pixels
    return pixels[..., [2, 1, 0, 3][: pixels.shape[2]]]
