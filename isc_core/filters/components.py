# mypy: disable-error-code="no-untyped-def"
"""Connected components of a mask.

Equation: one pass gives each pixel the label of a neighbour before it, and notes which labels meet;
a second one replaces them by consecutive numbers, in the order of the components' first pixels.

Citation: A. Rosenfeld and J. L. Pfaltz 1966, doi:10.1145/321356.321357; the forest of labels: R. E.
Tarjan 1975, doi:10.1145/321879.321884.
"""

import numpy as np

from ..numerics.jit import jit


def labelled(mask: np.ndarray, corners: bool = False) -> tuple[np.ndarray, int]:
    """Number the connected components of a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    corners : bool
        Whether pixels that touch at a corner are connected.

    Returns
    -------
    labels : (H, W) int32 ndarray
        From 1; 0 outside the mask.
    count : int
    """
    labels = np.empty(mask.shape, np.int32)
    most = (mask.shape[0] + 1) * (mask.shape[1] + 1) // 2 + 1  # a chessboard
    parents = np.empty(most, np.int32)
    return labels, _label(np.ascontiguousarray(mask), corners, labels, parents)


def boxes(labels: np.ndarray, count: int) -> list[tuple[slice, slice]]:
    """Return the bounding box of each component.

    Parameters
    ----------
    labels : (H, W) int ndarray
        From 1, each present; 0 elsewhere.
    count : int

    Returns
    -------
    list of tuple of slice
        Rows and columns.
    """
    at = np.nonzero(labels)
    numbers = labels[at]
    found = []
    for places, size in zip(at, labels.shape, strict=True):
        first, last = np.full(count + 1, size), np.full(count + 1, -1)
        np.minimum.at(first, numbers, places)
        np.maximum.at(last, numbers, places)
        ends = zip(first[1:].tolist(), last[1:].tolist(), strict=True)
        found.append([slice(start, end + 1) for start, end in ends])
    return list(zip(*found, strict=True))


def means(values: np.ndarray, labels: np.ndarray, count: int) -> np.ndarray:
    """Return the mean of the values over each component.

    Parameters
    ----------
    values : (H, W) ndarray
    labels : (H, W) int ndarray
        From 1, each present; 0 elsewhere.
    count : int

    Returns
    -------
    (count,) float64 ndarray
    """
    flat = labels.ravel()
    sums = np.bincount(flat, values.ravel(), count + 1)
    return np.asarray(sums[1:] / np.bincount(flat, minlength=count + 1)[1:])


@jit(inline=True)
def root(parents, member):
    """Return the first member of a tree, and shorten the way to it.

    Parameters
    ----------
    parents : (n,) int ndarray
        Of each member; a root is its own parent. Changed in place.
    member : int

    Returns
    -------
    int
    """
    while parents[member] != member:
        parents[member] = parents[parents[member]]
        member = parents[member]
    return member


@jit(types="b1[2] b1 i4[2] i4[1] -> i8")
def _label(mask, corners, labels, parents):
    """Write the labels and return their number; `parents` is memory for the forest."""
    height, width = mask.shape
    used = 1
    parents[0] = 0
    for i in range(height):
        for j in range(width):
            if not mask[i, j]:
                labels[i, j] = 0
                continue
            own = 0
            if j > 0 and mask[i, j - 1]:
                own = root(parents, labels[i, j - 1])
            if i > 0:
                first = j - 1 if corners and j > 0 else j
                last = j + 2 if corners and j + 1 < width else j + 1
                for k in range(first, last):
                    if mask[i - 1, k]:
                        other = root(parents, labels[i - 1, k])
                        if own == 0:
                            own = other
                        elif other < own:
                            parents[own] = other
                            own = other
                        else:
                            parents[other] = own
            if own == 0:
                own = used
                parents[own] = own
                used += 1
            labels[i, j] = own
    count = 0
    for label in range(1, used):
        if parents[label] == label:
            count += 1
            parents[label] = -count
        else:
            parents[label] = parents[parents[label]]  # smaller, and already numbered
    for i in range(height):
        for j in range(width):
            if labels[i, j] > 0:
                labels[i, j] = -parents[labels[i, j]]
    return count
