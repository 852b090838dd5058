"""Pairs of faces that share an edge.

Limits: an edge of three or more faces joins none of them, since no two of them are its sides.
"""

from dataclasses import dataclass

import numpy as np

_AHEAD = np.array([1, 2, 0])


@dataclass(frozen=True, eq=False)
class SharedEdges:
    """The edges of exactly two faces.

    Attributes
    ----------
    faces : (E, 2) ndarray of int
        The two faces.
    corners : (E, 2) ndarray of int
        The corner (0 to 2) of each face at which its half of the edge starts.
    opposite : (E,) ndarray of bool
        The faces run along the edge in opposite directions, as consistently wound ones do.
    boundary : int
        Number of edges of a single face.
    """

    faces: np.ndarray
    corners: np.ndarray
    opposite: np.ndarray
    boundary: int


def shared_edges(faces: np.ndarray) -> SharedEdges:
    """Find the edges of exactly two faces.

    Parameters
    ----------
    faces : (M, 3) ndarray of int
        Triangles on merged vertices.

    Returns
    -------
    SharedEdges
        Ordered by the numbers of the vertices of the edges.
    """
    start, end = faces.ravel(), faces[:, _AHEAD].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    keys = low.astype(np.int64) * (int(faces.max(initial=0)) + 1) + high
    order = np.argsort(keys, kind="stable")
    _, first, count = np.unique(keys[order], return_index=True, return_counts=True)
    halves = np.stack([order[first[count == 2]], order[first[count == 2] + 1]], -1)
    return SharedEdges(
        halves // 3,
        halves % 3,
        start[halves[:, 0]] != start[halves[:, 1]],
        int((count == 1).sum()),
    )
