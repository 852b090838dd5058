"""Smoothing of maps by the binomial filter, which counts pixels of a region alone.

Equation: sum w v / sum w, with w the filter's weights over the pixels that count (normalised
convolution).

Citation: H. Knutsson and C.-F. Westin, "Normalized and differential convolution", CVPR 1993,
doi:10.1109/CVPR.1993.341081.
"""

import numpy as np


def binomial(plane: np.ndarray, passes: int) -> np.ndarray:
    """Smooth a map over 3 x 3 pixels, several times.

    Parameters
    ----------
    plane : (H, W) ndarray
        The map, 0 beyond its borders.
    passes : int
        How often.

    Returns
    -------
    (H, W) float64 ndarray
    """
    smooth = np.pad(plane.astype(np.float64), 1)
    for _ in range(passes):
        for axis in (0, 1):
            smooth = (np.roll(smooth, 1, axis) + 2 * smooth + np.roll(smooth, -1, axis)) / 4
    return smooth[1:-1, 1:-1]


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


def smoothed_within(values: np.ndarray, counts: np.ndarray, passes: int) -> np.ndarray:
    """Smooth a map of the pixels that count, and continue it to those near them.

    Parameters
    ----------
    values : (H, W) ndarray
    counts : (H, W) bool ndarray
    passes : int
        Also the reach in pixels.

    Returns
    -------
    (H, W) float64 ndarray
        Beyond that reach as given.
    """
    weight = binomial(counts, passes)
    total = binomial(np.where(counts, values, 0), passes)
    return np.where(weight > 0, total / np.where(weight > 0, weight, 1), values)
