"""Triangles on a grid joined into quads, so that a mesh can be subdivided and edge loops selected.

Problem: a height map as few triangles bisects right isosceles triangles. Two that share their
hypotenuse form a square of the grid, for which artists and subdivision expect one face.

Method: a triangle whose shorter sides are equal and at a right angle, in the plane of the grid, is
joined with the one beyond its hypotenuse if that is alike. The quad begins at an end of the
hypotenuse: programs that split quads do so between its first and its third corner, which gives both
triangles back.

Limits: where two triangles fold by more than a right angle, Blender splits along the other
diagonal. Triangles of another size across the hypotenuse, and along the outline, stay triangles.
"""

import numpy as np

_CLOSE = 1e-6  # squared, in the unit of the positions


def joined_quads(faces: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join pairs of triangles that form squares of a grid.

    Parameters
    ----------
    faces : (F, 3) ndarray of int
        Vertices of triangles.
    places : (V, 2) ndarray
        Vertices in the plane of the grid.

    Returns
    -------
    corners : (L,) ndarray of int32
        Vertices of the corners of all faces, quads first.
    starts : (N,) ndarray of int32
        First corner of each face.
    """
    (quads, rest) = _paired(*_right_angled(faces, places))
    corners = np.concatenate([quads.ravel(), rest.ravel()]).astype(np.int32)
    starts = np.concatenate(
        [4 * np.arange(len(quads)), quads.size + 3 * np.arange(len(rest))]
    ).astype(np.int32)
    return corners, starts


def _right_angled(faces: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The faces turned so that the longest side comes first, and which of them are halves of a
    square.
    """
    ends = places[faces]
    sides = ((np.roll(ends, -1, axis=1) - ends) ** 2).sum(-1)
    first = sides.argmax(1)
    order = (first[:, None] + np.arange(3)) % 3
    longest, *legs = np.take_along_axis(sides, order, 1).T
    halves = (np.abs(legs[0] - legs[1]) < _CLOSE) & (np.abs(longest - 2 * legs[0]) < _CLOSE)
    return np.take_along_axis(faces, order, 1), halves & (longest > _CLOSE)


def _paired(faces: np.ndarray, halves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quads (Q, 4) of halves with a side in common that they pass in opposite directions, and the
    other triangles (R, 3).
    """
    index = np.flatnonzero(halves)
    a, b = faces[index, :2].astype(np.int64).T
    count = int(faces.max(initial=0)) + 1
    order = np.lexsort((a > b, np.minimum(a, b) * count + np.maximum(a, b)))
    index, a, b = index[order], a[order], b[order]
    meets = np.flatnonzero((a[:-1] == b[1:]) & (b[:-1] == a[1:]))
    one, other = index[meets], index[meets + 1]
    quads = np.stack([faces[one, 0], faces[other, 2], faces[one, 1], faces[one, 2]], -1)
    alone = np.ones(len(faces), bool)
    alone[one] = alone[other] = False
    return quads, faces[alone]
