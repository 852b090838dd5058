# mypy: disable-error-code="no-untyped-def"
"""Software rasteriser for a triangle mesh, turned about the vertical axis.

Problem: a contact sheet shows a mesh from the left and from the right, on any machine, without a
graphics library, with identical bytes everywhere.

Equation: the vertices are rotated about the vertical axis and projected orthographically. A
triangle (a, b, c) covers the pixel centres p whose barycentric coordinates, u = [p, b, c] / [a, b,
c] and so on, [.] being the signed area, are not negative. Depth and values are interpolated with
them, and of all triangles at a pixel the nearest is visible, of equally near ones the first. Each
is tested at all pixel centres of its bounding box. The picture is supersampled by 2 and averaged;
where values are places in a texture, its colours there, interpolated linearly, are averaged,
because a mean of the places on two surfaces would be meaningless.

Citation: J. Pineda, "A parallel algorithm for polygon rasterization", SIGGRAPH 1988,
doi:10.1145/54852.378457; the depth buffer: E. Catmull, "A subdivision algorithm for computer
display of curved surfaces", thesis, University of Utah, 1974.

Limits: no perspective; values are interpolated linearly. Efficient for triangles of a few pixels:
the cost of a triangle is that of its bounding box.
"""

from dataclasses import dataclass

import numpy as np

from ..numerics.jit import jit
from ..shading.lights import turn

_FINE = 2  # subpixels along a pixel's side
_EDGE = -1e-9  # tolerance of the barycentric coordinates of a pixel centre inside
_FEWEST = 1e-12  # twice the smallest area of a visible triangle, subpixels


@dataclass(frozen=True, eq=False)
class View:
    """Picture of a mesh.

    Attributes
    ----------
    values : (N, N, C) ndarray
        Mean of the vertices' values over the covered part of each pixel; 0 outside.
    coverage : (N, N) ndarray
        Coverage of each pixel by the mesh, in [0, 1].
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
    texture: np.ndarray | None = None,
) -> View:
    """Render a mesh that is rotated about the vertical axis.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        x right, y up, z toward the viewer.
    faces : (F, 3) ndarray of int
        Vertices of each triangle.
    values : (V, C) ndarray
        Colours or other vertex attributes.
    yaw : float
        Degrees; positive angles turn the front to the right, so that the left side is visible.
    side : int
        Pixels of the picture's side.
    zoom : float
        Picture pixels per unit length of the vertices, reduced if the mesh would not fit.
    room : float
        Share of the picture's side that the mesh may fill, in (0, 1].
    closed : bool
        Whether the mesh is closed, so that back faces are culled.
    texture : (h, w, D) ndarray, optional
        Values are row and column in it, clipped to its pixels; its colours are averaged instead.

    Returns
    -------
    View
        The turned mesh's bounding box is centred in the picture.
    """
    turned = np.asarray(vertices, np.float64) @ turn(yaw).T * (1, -1, 1)
    low, high = turned.min(axis=0), turned.max(axis=0)
    extent = float((high - low)[:2].max())
    scale = _FINE * min(zoom, room * side / extent if extent > 0 else zoom)
    points = (turned - (low + high) / 2) * scale + (_FINE * side / 2, _FINE * side / 2, 0)
    if closed:
        a, b, c = points[faces, :2].transpose(1, 0, 2)
        faces = faces[_cross(b - a, c - a) < 0]  # rows point downward
    fine = _nearest(points, faces, values, _FINE * side)
    if texture is None:
        cells = fine.reshape(side, _FINE, side, _FINE, -1).sum(axis=(1, 3))
    else:
        cells = np.zeros((side, side, texture.shape[2] + 1))
        _add_colors(fine, np.ascontiguousarray(texture, np.float64), cells)
    covered = np.rint(cells[..., -1])
    return View(cells[..., :-1] / np.maximum(covered, 1)[..., None], covered / _FINE**2)


def _nearest(points: np.ndarray, faces: np.ndarray, values: np.ndarray, side: int) -> np.ndarray:
    """The values of the nearest triangle at each pixel centre, and 1; (side, side, C + 1), 0 where
    there is none.

    `points` (V, 3): column and row in pixels, the first pixel from 0 to 1, and depth (larger is
    nearer).
    """
    carried = np.concatenate([values, np.ones((len(values), 1))], axis=1, dtype=np.float64)
    picture, nearest = np.zeros((side, side, carried.shape[1])), np.full((side, side), -np.inf)
    corners = np.ascontiguousarray(faces, np.int64)
    _draw(np.ascontiguousarray(points), corners, carried, nearest, picture)
    return picture


@jit(types="f8[2] i8[2] f8[2] f8[2] f8[3]")
def _draw(points, faces, carried, nearest, picture):
    """Draw each triangle where it passes the depth test: its corners' `carried` (V, C) into
    `picture` (N, N, C), its depth into `nearest` (N, N).
    """
    side = nearest.shape[0]
    for face in range(faces.shape[0]):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        ax, ay, bx, by = points[i, 0], points[i, 1], points[j, 0], points[j, 1]
        cx, cy = points[k, 0], points[k, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(area) <= _FEWEST:
            continue
        left, right = max(min(ax, bx, cx) - 0.5, 0.0), min(max(ax, bx, cx) - 0.5, side - 1.0)
        top, bottom = max(min(ay, by, cy) - 0.5, 0.0), min(max(ay, by, cy) - 0.5, side - 1.0)
        for row in range(int(np.ceil(top)), int(np.floor(bottom)) + 1):
            for column in range(int(np.ceil(left)), int(np.floor(right)) + 1):
                x, y = column + 0.5, row + 0.5
                u = ((cx - bx) * (y - by) - (cy - by) * (x - bx)) / area
                v = ((ax - cx) * (y - cy) - (ay - cy) * (x - cx)) / area
                w = 1 - u - v
                near = u * points[i, 2] + v * points[j, 2] + w * points[k, 2]
                if min(u, v, w) < _EDGE or near <= nearest[row, column]:
                    continue
                nearest[row, column] = near
                for c in range(carried.shape[1]):
                    picture[row, column, c] = (
                        u * carried[i, c] + v * carried[j, c] + w * carried[k, c]
                    )


@jit(types="f8[3] f8[3] f8[3]")
def _add_colors(fine, texture, cells):
    """Add the colours of a `texture` (h, w, D) at the places in `fine` (2N, 2N, 3), where the last
    value is 1, to the pixels of `cells` (N, N, D + 1), and count them there.
    """
    last_row, last_column = texture.shape[0] - 1, texture.shape[1] - 1
    for row in range(fine.shape[0]):
        for column in range(fine.shape[1]):
            if fine[row, column, 2] == 0.0:
                continue
            y = min(max(fine[row, column, 0], 0.0), float(last_row))
            x = min(max(fine[row, column, 1], 0.0), float(last_column))
            above, left = int(y), int(x)
            below, right = min(above + 1, last_row), min(left + 1, last_column)
            down, along = y - above, x - left
            for c in range(texture.shape[2]):
                upper = (1 - along) * texture[above, left, c] + along * texture[above, right, c]
                lower = (1 - along) * texture[below, left, c] + along * texture[below, right, c]
                color = (1 - down) * upper + down * lower
                cells[row // _FINE, column // _FINE, c] += color
            cells[row // _FINE, column // _FINE, texture.shape[2]] += 1.0


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
