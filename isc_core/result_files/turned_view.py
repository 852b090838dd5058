"""A triangle mesh seen from another side, drawn in software.

Problem: a contact sheet is to show what a mesh looks like from the left and from the right, on any
machine, without a graphics library, the same bytes everywhere.

Equation: the vertices are turned about the vertical axis and projected in parallel. A triangle
(a, b, c) covers the pixel centres p whose barycentric coordinates, u = [p, b, c] / [a, b, c] and so
on, [.] being the signed area, are not negative. Depth and values are sums of those of the vertices
weighted by them, and of all triangles at a pixel the nearest is seen. Triangles whose boxes have
about one size are tested together, at all pixel centres of their boxes. The picture is drawn twice
as fine and averaged.

Citation: J. Pineda, "A parallel algorithm for polygon rasterization", SIGGRAPH 1988,
doi:10.1145/54852.378457; the depth buffer: E. Catmull, "A subdivision algorithm for computer
display of curved surfaces", thesis, University of Utah, 1974.

Limits: no perspective; values are interpolated linearly, without textures. Made for triangles of a
few pixels: a triangle costs as much as its box.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..shading.lights import turn

_FINE = 2  # subpixels along a pixel's side
_EDGE = -1e-9  # barycentric coordinates from which a pixel centre lies inside
_FEWEST = 1e-12  # twice the area of a triangle that can be seen, subpixels
_TOGETHER = 1 << 18  # pixel centres that are tested at once


@dataclass(frozen=True)
class View:
    """Picture of a mesh.

    Attributes
    ----------
    values : (N, N, C) ndarray
        Mean of the vertices' values over the covered part of each pixel; 0 outside.
    coverage : (N, N) ndarray
        Share of each pixel that the mesh covers, in [0, 1].
    """

    values: np.ndarray
    coverage: np.ndarray


def turned_view(
    vertices: np.ndarray,
    faces: np.ndarray,
    values: np.ndarray,
    yaw: float,
    side: int,
    zoom: float,
    room: float = 1.0,
    closed: bool = False,
) -> View:
    """Draw a mesh that is turned about the vertical axis.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        x right, y up, z toward the viewer.
    faces : (F, 3) ndarray of int
        Vertices of each triangle.
    values : (V, C) ndarray
        Colours, or whatever else the vertices carry.
    yaw : float
        Degrees; positive ones turn the front to the right, so that the left side is seen.
    side : int
        Pixels of the picture's side.
    zoom : float
        Pixels of the picture for a unit length of the vertices, reduced where the mesh would not
        fit.
    room : float
        Share of the picture's side that the mesh may fill, in (0, 1].
    closed : bool
        Leave out what faces away: a closed mesh hides it.

    Returns
    -------
    View
        The middle of the turned mesh's box is the middle of the picture.
    """
    turned = np.asarray(vertices, np.float64) @ turn(yaw).T * (1, -1, 1)
    low, high = turned.min(axis=0), turned.max(axis=0)
    extent = float((high - low)[:2].max())
    scale = _FINE * min(zoom, room * side / extent if extent > 0 else zoom)
    points = (turned - (low + high) / 2) * scale + (_FINE * side / 2, _FINE * side / 2, 0)
    if closed:
        a, b, c = points[faces, :2].transpose(1, 0, 2)
        faces = faces[_cross(b - a, c - a) < 0]  # rows count downward
    fine = _nearest(points, faces, values, _FINE * side)
    steps = [(row, column) for row in range(_FINE) for column in range(_FINE)]
    cells = np.zeros((side, side, fine.shape[2]))
    for row, column in steps:
        cells += fine[row::_FINE, column::_FINE]
    covered = np.rint(cells[..., -1])
    return View(cells[..., :-1] / np.maximum(covered, 1)[..., None], covered / _FINE**2)


def _nearest(points: np.ndarray, faces: np.ndarray, values: np.ndarray, side: int) -> np.ndarray:
    """The values of the nearest triangle at each pixel centre, and 1; (side, side, C + 1), 0 where
    there is none.

    `points` (V, 3): column and row in pixels, the first pixel from 0 to 1, and nearness.
    """
    carried = np.concatenate([values, np.ones((len(values), 1))], axis=1)
    picture = np.zeros((side * side, carried.shape[1]))
    nearest = np.full(side * side, -np.inf)
    for pixel, depth, triangle, weights in _fragments(points, faces, side):
        before = nearest[pixel]
        np.maximum.at(nearest, pixel, depth)
        seen = (depth == nearest[pixel]) & (depth > before)
        corners = carried[faces[triangle[seen]]]
        picture[pixel[seen]] = np.einsum("nk,nkc->nc", weights[seen], corners)
    return picture.reshape(side, side, -1)


def _fragments(
    points: np.ndarray, faces: np.ndarray, side: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Pixels that triangles cover, some at a time: flat pixel, nearness, triangle, and its corners'
    weights, (N,), (N,), (N,), (N, 3).
    """
    corners = points[faces]
    plane = corners[..., :2]
    a, b, c = plane[:, 0], plane[:, 1], plane[:, 2]  # faster than reductions along three numbers
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    area = _cross(b - a, c - a)
    first = np.ceil(low - 0.5).clip(0, side).astype(np.int64)
    last = np.floor(high - 0.5).clip(-1, side - 1).astype(np.int64)
    size = last - first + 1
    shown = (np.abs(area) > _FEWEST) & (size > 0).all(axis=1)
    boxes = np.where(size <= 4, size, 2 ** np.ceil(np.log2(size.clip(1)))).astype(np.int64)
    kind = np.where(shown, boxes[:, 0] * (4 * side) + boxes[:, 1], 0)
    for code in np.flatnonzero(np.bincount(kind))[1 if (kind == 0).any() else 0 :]:
        width, height = divmod(int(code), 4 * side)
        column, row = (part.reshape(-1) for part in np.meshgrid(range(width), range(height)))
        chosen = np.flatnonzero(kind == code)
        for start in range(0, len(chosen), max(1, _TOGETHER // (width * height))):
            some = chosen[start : start + max(1, _TOGETHER // (width * height))]
            x, y = first[some, :1] + column, first[some, 1:] + row
            u, v = _barycentric(plane[some], area[some], x + 0.5, y + 0.5)
            w = 1 - u - v
            inside = (u >= _EDGE) & (v >= _EDGE) & (w >= _EDGE) & (x < side) & (y < side)
            triangle = np.broadcast_to(some[:, None], inside.shape)[inside]
            weights = np.stack([u[inside], v[inside], w[inside]], axis=1)
            nearness = np.einsum("nk,nk->n", weights, corners[triangle, :, 2])
            yield (y * side + x)[inside], nearness, triangle, weights


def _barycentric(
    plane: np.ndarray, area: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The first two coordinates (F, P) of the places x, y (F, P) in the triangles `plane`
    (F, 3, 2).
    """
    found = []
    for k in (1, 2):
        start, along = plane[:, k], (plane[:, (k + 1) % 3] - plane[:, k]) / area[:, None]
        found.append(along[:, :1] * (y - start[:, 1:]) - along[:, 1:] * (x - start[:, :1]))
    return found[0], found[1]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
