"""Smoothing of maps by the binomial filter, restricted to the pixels of a region.

Equation: sum w v / sum w, with w the filter's weights over the pixels of the region (normalised
convolution). A filter (1, 2, 1) / 4 applied n times is a row of Pascal's triangle over 4^n.

Citation: H. Knutsson and C.-F. Westin, "Normalized and differential convolution", CVPR 1993,
doi:10.1109/CVPR.1993.341081.
"""

import math
from collections.abc import Sequence

import numpy as np

from ...filters.correlation import correlated
from ...imaging.row_blocks import row_blocks


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
    taps = np.array([math.comb(2 * passes, k) for k in range(2 * passes + 1)]) / 4**passes
    smooth = np.empty(plane.shape)
    for block in row_blocks(plane.shape, halo=passes):  # few enough rows to stay in the cache
        down = correlated(plane[block.wide], taps, 0)[block.own]
        smooth[block.rows] = correlated(down, taps, 1)
    return smooth


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
