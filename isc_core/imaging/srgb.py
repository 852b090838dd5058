"""The transfer curve of sRGB.

It uses only NumPy, so that Blender's own process can use it, too.

Equation: coded = 12.92 L for L <= 0.0031308, else 1.055 L^(1/2.4) - 0.055.

Citation: IEC 61966-2-1:1999, Multimedia systems and equipment - Colour measurement and management -
Part 2-1: sRGB (no DOI).

Limits: nominally [0, 1]; other values follow the two branches of the curve.
"""

from functools import cache

import numpy as np

from .row_blocks import row_blocks

_CELLS = 4096  # narrower than the narrowest code, 1 / (255 x 12.92): at most one bound in each


def srgb_to_linear(coded: np.ndarray | float) -> np.ndarray:
    """Decode sRGB values to linear light.

    Parameters
    ----------
    coded : ndarray or float
        Nominally in [0, 1]; other values follow the two branches of the curve.

    Returns
    -------
    ndarray
    """
    x = np.asarray(coded)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: np.ndarray | float) -> np.ndarray:
    """Encode linear light as sRGB; the inverse of `srgb_to_linear`.

    Parameters
    ----------
    linear : ndarray or float
        Nominally in [0, 1].

    Returns
    -------
    ndarray
    """
    x = np.asarray(linear)
    return np.where(
        x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1.0 / 2.4) - 0.055
    )


def srgb_codes(linear: np.ndarray) -> np.ndarray:
    """Encode linear light as 8-bit sRGB: `linear_to_srgb` times 255, rounded, by a table in a fifth
    of the time.

    Parameters
    ----------
    linear : (...) float32 or float64 ndarray
        Clipped to [0, 1].

    Returns
    -------
    (...) uint8 ndarray
    """
    first, bound = _cells(linear.dtype.type)
    inside = np.clip(linear, 0, 1)
    cell = (inside * _CELLS).astype(np.int16)
    codes = first.take(cell)
    codes += inside >= bound.take(cell)
    return codes


def share_codes(values: np.ndarray) -> np.ndarray:
    """Encode values in [0, 1] linearly with 8 bits.

    Parameters
    ----------
    values : (H, W) ndarray
        Clipped to [0, 1].

    Returns
    -------
    (H, W) uint8 ndarray
    """
    codes = np.empty(values.shape, np.uint8)
    for block in row_blocks(values.shape):  # small enough for the cache
        codes[block.rows] = np.rint(255 * np.clip(values[block.rows], 0, 1))
    return codes


@cache
def _cells(dtype: type[np.floating]) -> tuple[np.ndarray, np.ndarray]:
    """The code at the beginning of each cell, and the value at which the next code begins."""
    bounds = _bounds(dtype)
    begins = np.arange(_CELLS + 1, dtype=dtype) / _CELLS
    first = np.searchsorted(bounds, begins, side="right")
    return first.astype(np.uint8), np.append(bounds, dtype(2))[first]


def _bounds(dtype: type[np.floating]) -> np.ndarray:
    """The smallest number of a type that rounds to each code from 1 to 255, by bisection."""
    codes = np.arange(1, 256)
    low, high = np.zeros(255, dtype), np.ones(255, dtype)
    while True:
        middle = (low + high) / 2
        inside = (low < middle) & (middle < high)
        if not inside.any():
            return high
        reached = np.rint(255 * linear_to_srgb(middle)) >= codes
        high = np.where(inside & reached, middle, high)
        low = np.where(inside & ~reached, middle, low)
