# mypy: disable-error-code="no-untyped-def"
"""Weighted averages of an image, down and then across, with even weights.

Equation: y[i, j] = sum_k sum_l t[|k|] t[|l|] x[i + k, j + l] for -r <= k, l <= r. Beyond its border
the image is mirrored, or zero. One pass over the rows averages a row down, rounds it to the image's
type, and averages it across. Sums are in float64, from the outermost pair of pixels to the
innermost.

Limits: the time of a pixel is proportional to r.
"""

import numpy as np

from ..numerics.jit import jit


def separable_average(image: np.ndarray, taps: np.ndarray, *, mirrored: bool) -> np.ndarray:
    """Average an image down and across.

    Parameters
    ----------
    image : (H, W) float32 or float64 ndarray
    taps : (r + 1,) ndarray
        Weights from the centre outwards.
    mirrored : bool
        Whether the image is mirrored at its border; otherwise it is zero beyond.

    Returns
    -------
    (H, W) ndarray
        Of the image's type.
    """
    rows, columns = (_places(n, len(taps) - 1, mirrored) for n in image.shape)
    source = np.ascontiguousarray(image)
    if not mirrored:
        source = np.concatenate([source, np.zeros_like(source[:1])])
    line = np.zeros(image.shape[1] + 2 * len(taps) - 1, image.dtype)  # the last value stays zero
    result = np.empty(image.shape, image.dtype)
    _average(source, rows, columns, taps, np.empty(image.shape[1]), line, result)
    return result


def _places(size: int, radius: int, mirrored: bool) -> np.ndarray:
    """Index of the pixel that each position from -radius to size + radius - 1 shows."""
    at = np.arange(-radius, size + radius)
    if not mirrored:
        return np.where((at >= 0) & (at < size), at, size)
    at = at % (2 * size)
    return np.minimum(at, 2 * size - 1 - at)


@jit(types="r[2] i8[1] i8[1] f8[1] f8[1] r[1] r[2]")
def _average(image, rows, columns, taps, total, line, result):
    """Average `image` down and across; `rows` and `columns` are the pixels from a radius before the
    first to a radius beyond the last, `total` and `line` are memory for one row.
    """
    radius = len(taps) - 1
    height, width = result.shape
    beyond = len(line) - 1
    inner = line[radius : radius + width]
    for i in range(height):
        centre, weight = image[rows[i + radius]], taps[0]
        for j in range(width):
            total[j] = centre[j] * weight
        for k in range(radius, 0, -1):
            above, below = image[rows[i + radius - k]], image[rows[i + radius + k]]
            weight = taps[k]  # a local variable: the compiler uses vectors
            for j in range(width):
                total[j] += (np.float64(above[j]) + np.float64(below[j])) * weight
        for j in range(width):
            inner[j] = total[j]
        for j in range(radius):
            first, last = columns[j], columns[radius + width + j]
            line[j] = line[radius + first if first < width else beyond]
            line[radius + width + j] = line[radius + last if last < width else beyond]
        weight = taps[0]
        for j in range(width):
            total[j] = inner[j] * weight
        for k in range(radius, 0, -1):
            left, right = line[radius - k :], line[radius + k :]
            weight = taps[k]
            for j in range(width):
                total[j] += (np.float64(left[j]) + np.float64(right[j])) * weight
        row = result[i]
        for j in range(width):
            row[j] = total[j]
