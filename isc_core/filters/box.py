"""Means over a square window around each pixel.

Equation: the mean of the n x n pixels around a pixel, n odd. Beyond its border the image is
mirrored, or zero. Sums are in float64; no value is subtracted again, so that the mean of a window
of zeros is 0.

Limits: the time of a pixel grows with log n.
"""

import numpy as np


def box_average(values: np.ndarray, size: int, *, mirrored: bool = False) -> np.ndarray:
    """Average an image over square windows.

    Parameters
    ----------
    values : (H, W, ...) ndarray of float
    size : int
        Side of the window in pixels, odd.
    mirrored : bool
        Whether the image is mirrored at its border; otherwise it is zero beyond.

    Returns
    -------
    ndarray
        Of the shape and type of `values`.
    """
    sums = values.astype(np.float64)
    for axis in (0, 1):
        sums = _window_sums(sums, size, axis, mirrored)
    return (sums / size**2).astype(values.dtype)


def _window_sums(values: np.ndarray, size: int, axis: int, mirrored: bool) -> np.ndarray:
    """Sums along an axis, of runs whose lengths are the powers of two of the window's.

    `runs[i]` is the sum of `length` pixels from i on.
    """
    radius, count = size // 2, values.shape[axis]
    width = [(radius, radius) if k == axis else (0, 0) for k in range(values.ndim)]
    padded = np.pad(values, width, mode="symmetric" if mirrored else "constant")
    runs, length, start = np.moveaxis(padded, axis, 0), 1, 0
    sums = np.zeros_like(runs[:count])
    while True:
        if size & length:
            sums += runs[start : start + count]
            start += length
        if start == size:
            break
        runs = runs[: len(runs) - length] + runs[length:]
        length *= 2
    return np.moveaxis(sums, 0, axis)
