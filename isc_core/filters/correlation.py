"""Correlation along one axis of an array, with few taps.

Equation: y[i] = sum_k t[k] x[i + k] for -r <= k <= r, the pairs of taps from the outermost to the
innermost. Beyond its border the array is zero, or periodic.
"""

import numpy as np


def correlated(
    values: np.ndarray, taps: np.ndarray, axis: int, periodic: bool = False
) -> np.ndarray:
    """Correlate an array with taps.

    Parameters
    ----------
    values : ndarray
    taps : (2 r + 1,) ndarray
        Either even or odd about their centre.
    axis : int
        The array has at least r values along it, if it is periodic.
    periodic : bool
        Whether the array is periodic along the axis; otherwise it is zero beyond its border.

    Returns
    -------
    float64 ndarray
        Of the array's shape.
    """
    radius, count = len(taps) // 2, values.shape[axis]
    sign = 1.0 if np.array_equal(taps, taps[::-1]) else -1.0
    width = [(radius, radius) if k == axis % values.ndim else (0, 0) for k in range(values.ndim)]
    padded = np.moveaxis(np.pad(values, width, mode="wrap" if periodic else "constant"), axis, 0)
    total = taps[radius] * padded[radius : radius + count].astype(float)
    for k in range(radius, 0, -1):
        before, beyond = padded[radius - k :][:count], padded[radius + k :][:count]
        total += taps[radius - k] * (before + sign * beyond)
    return np.moveaxis(total, 0, axis)
