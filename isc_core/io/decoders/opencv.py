"""Images of 16 bits per channel and floats, decoded by OpenCV."""

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
    MemoryError
        If memory is exhausted.
    ValueError
        If OpenCV cannot decode it.
    """
    import cv2  # takes a tenth of a second, and most photos do without

    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise (MemoryError if error.code == cv2.Error.StsNoMem else ValueError)(error.err) from None
    if pixels is None:
        raise ValueError("not decoded")
    if pixels.ndim == 2:
        return pixels
    return pixels[..., [2, 1, 0, 3][: pixels.shape[2]]]
