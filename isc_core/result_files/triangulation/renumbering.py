"""Consecutive numbers for the vertices of triangles.

Faster than `numpy.unique`, which sorts all corners: vertices are numbered from 0, so that a flag
for each is enough.
"""

import numpy as np


def renumbered(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number the used vertices consecutively from 0, in their order.

    Parameters
    ----------
    corners : (...) ndarray of int
        Not negative.

    Returns
    -------
    used : (N,) int64 ndarray
        The used vertices, in ascending order.
    renumbered : (...) int64 ndarray
        The index of each corner's vertex in `used`.
    """
    in_use = np.zeros(int(corners.max(initial=-1)) + 1, bool)
    in_use[corners] = True
    used = np.flatnonzero(in_use)
    place = np.empty(len(in_use), np.int64)
    place[used] = np.arange(len(used))
    return used, place[corners]
