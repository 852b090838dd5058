"""Triangles without normals or texture coordinates, and the repairs that every file needs.

Equation: vertices whose coordinates agree after division by TOLERANCE times the longest side and
rounding are one. Faces with two equal corners, faces of no area and second copies of a face are
dropped.

Limits: two vertices closer than the tolerance can round to different numbers, and then stay two.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

TOLERANCE = 1e-5  # relative to the longest side
_NO_AREA = 1e-12  # relative to the longest side squared
_DECIMALS = 6


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles.

    Attributes
    ----------
    vertices : (N, 3) ndarray
        Positions.
    faces : (M, 3) ndarray of int
        Vertex indices.
    """

    vertices: np.ndarray
    faces: np.ndarray

    def corners(self) -> np.ndarray:
        """Return the positions of the corners of every face, (M, 3, 3)."""
        return self.vertices[self.faces]

    def areas(self) -> np.ndarray:
        """Return the area of every face, (M,)."""
        a, b, c = np.moveaxis(self.corners(), 1, 0)
        return np.linalg.norm(np.cross(b - a, c - a), axis=-1) / 2

    def extents(self) -> np.ndarray:
        """Return the sides of the bounding box of the faces, (3,); zero without faces."""
        used = self.vertices[self.faces.ravel()]
        return np.ptp(used, axis=0) if len(used) else np.zeros(3)

    def part(self, chosen: np.ndarray) -> "Surface":
        """Return some of the faces, with their vertices alone.

        Parameters
        ----------
        chosen : ndarray
            Mask (M,) or indices of the faces.

        Returns
        -------
        Surface
            The faces in their order.
        """
        used, faces = np.unique(self.faces[chosen], return_inverse=True)
        return Surface(self.vertices[used], faces.reshape(-1, 3))


def welded(surface: Surface) -> tuple[Surface, np.ndarray]:
    """Merge vertices at the same position and drop faces without area or drawn twice.

    Parameters
    ----------
    surface : Surface
        Finite vertices.

    Returns
    -------
    surface : Surface
        The merged surface.
    kept : (K,) ndarray of int
        The old number of each face that is left.
    """
    size = float(surface.extents().max()) or 1.0
    low = surface.vertices[surface.faces.ravel()].min(0, initial=np.inf)
    surface = surface.part(np.arange(len(surface.faces)))
    keys = np.round((surface.vertices - low) / (TOLERANCE * size)).astype(np.int64)
    number = np.ravel_multi_index(tuple(keys.T), (round(1 / TOLERANCE) + 2,) * 3)
    _, first, place = np.unique(number, return_index=True, return_inverse=True)
    merged = Surface(surface.vertices[first], place.reshape(-1)[surface.faces].reshape(-1, 3))
    kept = np.flatnonzero(merged.areas() > _NO_AREA * size**2)
    sorted_faces = np.sort(merged.faces[kept], axis=1)
    order = np.lexsort(sorted_faces.T)
    new = np.any(np.diff(sorted_faces[order], axis=0, prepend=-1), axis=1)
    once = order[new]
    kept = kept[np.sort(once)]
    return merged.part(kept), kept


def fitted(surface: Surface) -> Surface:
    """Centre a surface by its bounding box and scale its longest side to 2.

    Parameters
    ----------
    surface : Surface
        With a longest side above 0.

    Returns
    -------
    Surface
        The same faces.
    """
    used = surface.vertices[surface.faces.ravel()]
    low, high = used.min(0), used.max(0)
    scale = 2 / (high - low).max()
    return Surface((surface.vertices - (low + high) / 2) * scale, surface.faces)


def together(surfaces: Sequence[Surface]) -> Surface:
    """Concatenate surfaces; where they overlap, all stay.

    Parameters
    ----------
    surfaces : sequence of Surface
        At least one.

    Returns
    -------
    Surface
        All faces, in the order given.
    """
    starts = np.cumsum([0, *(len(one.vertices) for one in surfaces)])
    faces = [one.faces + start for one, start in zip(surfaces, starts, strict=False)]
    return Surface(np.concatenate([one.vertices for one in surfaces]), np.concatenate(faces))


def in_fixed_order(surface: Surface) -> Surface:
    """Round the vertices and order them and the faces by their values.

    Libraries that work on several threads return the same triangles in another order each time,
    with other last digits.

    Parameters
    ----------
    surface : Surface
        Of about unit size.

    Returns
    -------
    Surface
        The same triangles, each from its lowest vertex on.
    """
    vertices = np.round(surface.vertices, _DECIMALS) + 0.0  # no negative zeros
    order = np.lexsort(vertices.T)
    place = np.empty(len(order), int)
    place[order] = np.arange(len(order))
    faces = place[surface.faces]
    turn = (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(faces, turn, 1)
    return Surface(vertices[order], faces[np.lexsort(faces.T)])
