"""Smoothing of maps by the binomial filter, restricted to the pixels of a region.

Equation: sum w v / sum w, with w the filter's weights over the pixels of the region (normalised
convolution).

Citation: H. Knutsson and C.-F. Westin, "Normalized and differential convolution", CVPR 1993,
doi:10.1109/CVPR.1993.341081.
"""

from collections.abc import Sequence

import numpy as np


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
    smooth = np.pad(plane.astype(np.float64), 1)
    other = np.empty_like(smooth)
    for _ in range(passes):
        _filter_down(smooth, other)
        _filter_down(other.T, smooth.T)
    return smooth[1:-1, 1:-1]


def _filter_down(plane: np.ndarray, out: np.ndarray) -> None:
    """Filter a map down its columns, with periodic boundaries."""
    np.multiply(plane, 2, out=out)
    out[1:] += plane[:-1]
    out[0] += plane[-1]
    out[:-1] += plane[1:]
    out[-1] += plane[0]
    out /= 4


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
