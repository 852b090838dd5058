"""Smoothing of maps by the binomial filter, restricted to the pixels of a region.

Equation: sum w v / sum w, with w the filter's weights over the pixels of the region (normalised
convolution). A filter (1, 2, 1) / 4 applied n times is a row of Pascal's triangle over 4^n.

Citation: H. Knutsson and C.-F. Westin, "Normalized and differential convolution", CVPR 1993,
doi:10.1109/CVPR.1993.341081.
"""

import math
from collections.abc import Sequence

import numpy as np

_ROWS = 128


def binomial(plane: np.ndarray, passes: int) -> np.ndarray:
    """Smooth a map over 3 x 3 pixels, several times.

    Parameters
    ----------
    plane : (H, W) ndarray
        The map, 0 beyond its borders.
    passes : int
        Number of repetitions.

    Returns
    -------
    (H, W) float64 ndarray
    """
    taps = [math.comb(2 * passes, k) / 4**passes for k in range(passes, 2 * passes + 1)]
    height, width = plane.shape
    padded = np.pad(plane.astype(np.float64), passes)
    smooth = np.empty((height, width))
    for start in range(0, height, _ROWS):  # few enough rows to stay in the cache
        rows = padded[start : min(start + _ROWS, height) + 2 * passes]
        down = _weighted(rows, taps)
        smooth[start : start + _ROWS] = _weighted(down.T, taps).T
    return smooth


def _weighted(rows: np.ndarray, taps: Sequence[float]) -> np.ndarray:
    """Weighted sums of rows (h + 2 r, w) down to (h, w), with even weights from the centre out."""
    reach = len(taps) - 1
    count = len(rows) - 2 * reach
    total = taps[0] * rows[reach : reach + count]
    pair = np.empty_like(total)
    for k in range(1, reach + 1):
        np.add(rows[reach - k :][:count], rows[reach + k :][:count], out=pair)
        pair *= taps[k]
        total += pair
    return total


def surrounded(inside: np.ndarray) -> np.ndarray:
    """Return the pixels whose four neighbours are inside, too.

    Parameters
    ----------
    inside : (H, W) bool ndarray

    Returns
    -------
    (H, W) bool ndarray
    """
    at = np.pad(inside, 1)
    vertical, horizontal = at[:-2, 1:-1] & at[2:, 1:-1], at[1:-1, :-2] & at[1:-1, 2:]
    return np.asarray(inside & vertical & horizontal)


def smoothed_within(
    maps: Sequence[np.ndarray], counts: np.ndarray, passes: int
) -> list[np.ndarray]:
    """Smooth maps over the pixels of a region, and extend them to nearby pixels.

    Parameters
    ----------
    maps : sequence of (H, W) ndarray
    counts : (H, W) bool ndarray
    passes : int
        Number of repetitions, and the radius of the extension in pixels.

    Returns
    -------
    list of (H, W) float64 ndarray
        Unchanged beyond that radius.
    """
    weight = binomial(counts, passes)
    reached = weight > 0
    weight[~reached] = 1
    return [
        np.where(reached, binomial(np.where(counts, values, 0), passes) / weight, values)
        for values in maps
    ]
