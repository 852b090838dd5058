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
    radius = len(taps) // 2
    sign = 1.0 if np.array_equal(taps, taps[::-1]) else -1.0
    lines = np.moveaxis(values, axis, 0)
    total = np.multiply(lines, taps[radius], dtype=float)
    pair = np.empty_like(total)
    for k in range(radius, 0, -1):
        _write_pair_sums(pair, lines, k, sign, periodic)
        pair *= taps[radius - k]
        total += pair
    return np.moveaxis(total, 0, axis)


def _write_pair_sums(
    pair: np.ndarray, lines: np.ndarray, k: int, sign: float, periodic: bool
) -> None:
    """Write x[i - k] + sign x[i + k] to `pair`; no copy of the array is padded."""
    inside = max(len(lines) - k, 0)
    add = np.add if sign > 0 else np.subtract
    pair[k:] = lines[:inside]
    pair[:k] = lines[inside:] if periodic else 0
    add(pair[:inside], lines[k:], out=pair[:inside])
    if periodic:
        add(pair[inside:], lines[:k], out=pair[inside:])
