"""Bright details of a map by size: the differences of openings with larger and larger squares.

Problem: a highlight, a letter and a stripe are brighter than their surroundings. The size of such a
detail determines the size of the opening that removes it.

Equation: with the opening o_r by a square of 2 r + 1 pixels, o_0 the map itself,

    band_k = o_{r_(k-1)} - o_{r_k} >= 0.

Pixels outside the mask are ignored by minima and maxima.

Citation: granulometry: G. Matheron, "Random Sets and Integral Geometry", 1975; openings: J. Serra,
"Image Analysis and Mathematical Morphology", 1982.

Limits: square openings are not isotropic. A ramp toward the mask's outline counts as a detail.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from ..filters.extrema import window_maximum, window_minimum


def brightness_bands(
    values: np.ndarray, mask: np.ndarray, reaches: Sequence[int]
) -> Iterator[np.ndarray]:
    """Divide the bright details of a map into bands.

    Parameters
    ----------
    values : (H, W) ndarray
    mask : (H, W) ndarray of bool
    reaches : sequence of int
        Radii r_1, r_2, ... in pixels, ascending.

    Yields
    ------
    (H, W) ndarray
        One for each radius, the finest details first; not negative, 0 outside the mask.
    """
    before = values = np.where(mask, values, 0)
    for reach in reaches:
        after = np.minimum(before, _opened(values, mask, 2 * reach + 1))
        yield before - after
        before = after


def _opened(values: np.ndarray, mask: np.ndarray, side: int) -> np.ndarray:
    most, least = np.asarray([np.inf, -np.inf], values.dtype)
    low = window_minimum(np.where(mask, values, most), side)
    high = window_maximum(np.where(mask, low, least), side)
    return np.where(mask, high, 0)
