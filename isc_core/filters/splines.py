# mypy: disable-error-code="no-untyped-def"
"""Cubic splines through the values of a grid.

Equation: f(x) = sum_k c_k B(x - k) with the cubic B-spline B. The coefficients are found by a
recursion along each axis and another one back, with the pole sqrt(3) - 2, for values that are
mirrored at the border, about the first and last grid points or half a step beyond them.

Citation: M. Unser, A. Aldroubi and M. Eden 1991, doi:10.1109/34.75515.
"""

import numpy as np

from ..numerics.ellpack import Ellpack
from ..numerics.jit import jit
from .interpolation import resampled_plane

_POLE = np.sqrt(3.0) - 2.0
_GAIN = (1.0 - _POLE) * (1.0 - 1.0 / _POLE)


def spline_coefficients(values: np.ndarray, half_step: bool = False) -> np.ndarray:
    """Return the coefficients of a spline of two variables.

    Parameters
    ----------
    values : (H, W) ndarray
    half_step : bool
        Whether the values are mirrored half a step beyond the border, so that the outermost ones
        occur twice.

    Returns
    -------
    (H, W) float64 ndarray
    """
    down = _filtered(np.array(values, float), half_step)
    return np.ascontiguousarray(_filtered(np.ascontiguousarray(down.T), half_step).T)


def spline_values(coefficients: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Evaluate a spline on a grid; it is mirrored half a step beyond the border.

    Parameters
    ----------
    coefficients : (H, W) float64 ndarray
        With `half_step`.
    rows : (h,) ndarray
        In [0, H - 1].
    columns : (w,) ndarray
        In [0, W - 1].

    Returns
    -------
    (h, w) float64 ndarray
    """
    height, width = coefficients.shape
    return resampled_plane(coefficients, _taps(rows, height), _taps(columns, width))


def _filtered(values: np.ndarray, half_step: bool) -> np.ndarray:
    """Turn values (n, m) into coefficients along the first axis, in place."""
    if len(values) > 1:
        values *= _GAIN
        _recursions(values, _POLE, half_step, np.empty(values.shape[1]))
    return values


def _taps(places: np.ndarray, size: int) -> Ellpack:
    """(n, size) values of the four B-splines that are not zero at each place."""
    first = np.minimum(np.floor(places), size - 1).astype(np.int64)
    x = places - first
    y = 1 - x
    weights = np.stack([y**3, 4 - 6 * x**2 + 3 * x**3, 4 - 6 * y**2 + 3 * y**3, x**3], axis=1)
    at = first[:, None] + np.arange(-1, 3)
    at = np.where(at < 0, -1 - at, at)
    at = np.where(at >= size, 2 * size - 1 - at, at)
    return Ellpack(np.clip(at, 0, size - 1), weights / 6, size)


@jit(types="f8[2] f8 b1 f8[1]")
def _recursions(c, pole, half_step, first):
    """Filter the columns of `c` down and up; `first` is memory for one row."""
    count, width = c.shape
    last = count - 1
    # The causal filter begins with the sum over the mirrored values before the first.
    far = pole ** (count if half_step else last)
    for j in range(width):
        first[j] = c[0, j] + far * c[last, j]
    power = pole
    for k in range(1, count if half_step else last):
        row, mirrored = c[k], c[last - k]
        for j in range(width):
            first[j] += power * (row[j] + far * mirrored[j])
        power *= pole
    for j in range(width):
        if half_step:
            c[0, j] += first[j] * (pole / (1 - far * far))
        else:
            c[0, j] = first[j] / (1 - far * far)
    for k in range(1, count):
        row, before = c[k], c[k - 1]
        for j in range(width):
            row[j] += pole * before[j]
    row, before = c[last], c[last - 1]
    for j in range(width):
        if half_step:
            row[j] *= pole / (pole - 1)
        else:
            row[j] = (pole * before[j] + row[j]) * pole / (pole * pole - 1)
    for k in range(last - 1, -1, -1):
        row, beyond = c[k], c[k + 1]
        for j in range(width):
            row[j] = pole * (beyond[j] - row[j])
