"""Means over a square window around each pixel.

Equation: the mean of the n x n pixels around a pixel, n odd. Beyond its border the image is
mirrored, or zero (see `separable`). No value is subtracted again, so that the mean of a window of
zeros is 0.

Limits: the time of a pixel is proportional to n.
"""

import numpy as np

from .separable import separable_average


def box_average(values: np.ndarray, size: int, *, mirrored: bool = False) -> np.ndarray:
    """Average an image over square windows.

    Parameters
    ----------
    values : (H, W, ...) float32 or float64 ndarray
    size : int
        Side of the window in pixels, odd.
    mirrored : bool
        Whether the image is mirrored at its border; otherwise it is zero beyond.

    Returns
    -------
    ndarray
        Of the shape and type of `values`.
    """
    taps = np.full(size // 2 + 1, 1 / size)
    planes = np.moveaxis(values.reshape(*values.shape[:2], -1), 2, 0)
    means = [separable_average(plane, taps, mirrored=mirrored) for plane in planes]
    return np.stack(means, axis=2).reshape(values.shape)
