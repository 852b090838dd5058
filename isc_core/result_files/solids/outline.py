"""Triangulation with a smooth outline between the pixels.

Problem: a mesh of whole cells of pixels ends in steps. The object's edge is known more accurately
from the coverage of its pixels, or can be smoothed if only a mask is known.

Method: marching squares. Cells with four pixels inside have the triangles of the adaptive mesh; a
cell with one to three is cut where the coverage, smoothed over 3 x 3 pixels, falls to one half. Two
pixels that only meet at a corner are not connected, so that each point of the outline lies between
two of its edges.

Citation: W. E. Lorensen and H. E. Cline, "Marching cubes", SIGGRAPH 1987, doi:10.1145/37402.37422.

Limits: points of the outline are at least a tenth of a pixel away from the pixels' centres; parts
thinner than a pixel are lost.
"""

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ..triangulation.adaptive_triangles import Triangulation, adaptive_triangles
from ..triangulation.renumbering import renumbered
from .smoothing import binomial

_CLOSEST = 0.1  # pixels
_ALL = 1 << 40  # more triangles than any mesh has
_RING = ((0, 0), (1, 0), (1, 1), (0, 1))  # row, column of a cell's corners, counter-clockwise


@dataclass(frozen=True, eq=False)
class Outlined:
    """Triangles in the plane of the pixels.

    Attributes
    ----------
    places : (V, 2) float64 ndarray
        Row and column of each vertex; the last ones are the points of the outline.
    pixels : (V, 2) int64 ndarray
        The nearest pixel inside.
    inner : int
        Number of vertices that are pixels.
    faces : (F, 3) int64 ndarray
        Vertices, counter-clockwise for the viewer; at least one of each face is a pixel.
    """

    places: np.ndarray
    pixels: np.ndarray
    inner: int
    faces: np.ndarray

    @property
    def pixel_triangles(self) -> Triangulation:
        """The triangles whose vertices are all pixels."""
        between = (self.faces < self.inner).all(1)
        return Triangulation(self.pixels[: self.inner], self.faces[between])


def smooth_cover(cover: np.ndarray) -> np.ndarray:
    """Return the coverage whose contour at one half is the outline.

    Parameters
    ----------
    cover : (H, W) ndarray
        In [0, 1]; 0 or 1 for a hard mask.

    Returns
    -------
    (H, W) float64 ndarray
        Smoothed twice over 3 x 3 pixels, 0 at the frame's border.
    """
    smooth = binomial(cover, 2)
    smooth[[0, -1]] = 0
    smooth[:, [0, -1]] = 0
    return smooth


def outlined(
    smooth: np.ndarray,
    height: np.ndarray,
    cosine: np.ndarray,
    budget: int,
    *,
    with_wall: bool = False,
) -> Outlined:
    """Triangulate the inside of the outline.

    Parameters
    ----------
    smooth : (H, W) ndarray
        Of `smooth_cover`.
    height, cosine : (H, W) ndarray
        As for `adaptive_triangles`.
    budget : int
        Largest number of triangles, with those along the outline; 0 for two per cell. Those
        required by the outline are always made.
    with_wall : bool
        Leave one triangle of the budget for each edge of the outline.

    Returns
    -------
    Outlined

    Raises
    ------
    InputError
        If no block of 2 x 2 pixels lies inside.
    """
    inside, width = smooth > 0.5, smooth.shape[1]
    corners = np.stack(
        [inside[r : r - 1 or None, c : c - 1 or None] for r, c in _RING]
    )  # (4, H - 1, W - 1)
    count = corners.sum(0)
    cells = count == 4
    if not cells.any():
        raise InputError(
            "the mask has no block of 2 x 2 pixels to build a mesh from: mark a larger region or "
            "use a larger photo"
        )
    cut = _cut_cells(corners, width, smooth.size)
    if budget:
        edges = np.count_nonzero(corners & ~np.roll(corners, 1, axis=0)) if with_wall else 0
        budget = max(1, budget - len(cut) - edges)
    grid = adaptive_triangles(height, cells, cosine, budget or _ALL)
    if grid is None:  # the outline alone needs more
        grid = adaptive_triangles(height, cells, cosine, 0)
    assert grid is not None
    flat = grid.vertices @ (width, 1)
    faces = np.concatenate([flat[grid.faces], cut])
    used, faces = renumbered(faces)
    inner = int(np.searchsorted(used, smooth.size))
    pixels, places = _positions(used, inner, smooth)
    return Outlined(places, pixels, inner, faces)


def _cut_cells(corners: np.ndarray, width: int, size: int) -> np.ndarray:
    """Triangles (F, 3) of the cells that the outline crosses.

    A pixel is its flat index, the point between it and its right neighbour the index plus `size`,
    and between it and its lower neighbour the index plus 2 `size`.
    """
    code = np.zeros(corners.shape[1:], np.uint8)
    for k, full in enumerate(corners):
        code |= full.astype(np.uint8) << k
    columns, rows = np.nonzero(((code > 0) & (code < 15)).T)
    cases = code[rows, columns]
    found = [np.zeros((0, 3), np.int64)]
    for case in range(1, 15):
        at = np.flatnonzero(cases == case)
        row, column = rows[at], columns[at]
        corner = [(row + r) * width + column + c for r, c in _RING]
        left, upper = corner[0], corner[0]
        point = [left + 2 * size, corner[1] + size, corner[3] + 2 * size, upper + size]
        found += [
            np.stack([(corner if kind else point)[k] for kind, k in triangle], -1)
            for triangle in _polygons(case)
        ]
    return np.concatenate(found)


def _polygons(case: int) -> list[list[tuple[int, int]]]:
    """Triangles of a case of marching squares: (1, k) is corner k, (0, k) the point between k and k
    + 1.
    """
    full = [bool(case >> k & 1) for k in range(4)]
    triangles = []
    for first in (k for k in range(4) if full[k] and not full[k - 1]):
        run = [first]
        while full[(run[-1] + 1) % 4]:
            run.append((run[-1] + 1) % 4)
        polygon = [(1, k) for k in run] + [(0, run[-1]), (0, (first - 1) % 4)]
        hub = len(run) // 2 if len(run) == 3 else 0
        polygon = polygon[hub:] + polygon[:hub]
        triangles += [[polygon[0], polygon[k], polygon[k + 1]] for k in range(1, len(polygon) - 1)]
    return triangles


def _positions(used: np.ndarray, inner: int, smooth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nearest pixels inside (V, 2), and the positions (V, 2)."""
    width, size, values = smooth.shape[1], smooth.size, smooth.reshape(-1)
    start = used % size
    end = start + np.select([used >= 2 * size, used >= size], [width, 1], 0)
    a, b = values[start], values[end]
    share = np.clip((0.5 - a) / np.where(a == b, 1, b - a), _CLOSEST, 1 - _CLOSEST)
    share[:inner] = 0
    at = [np.stack(np.divmod(index, width), -1) for index in (start, end)]
    places = at[0] + share[:, None] * (at[1] - at[0])
    return np.where((a > 0.5)[:, None], at[0], at[1]), places
