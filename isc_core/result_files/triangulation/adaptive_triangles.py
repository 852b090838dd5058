"""Adaptive triangulation of a height map: large triangles where it is flat, pixels at the
silhouette.

Problem: a mesh with a vertex at each pixel has two triangles per pixel. Most of them are in smooth
regions, where larger ones suffice; the silhouette must stay exact.

Method: a restricted quadtree, also known as right-triangulated irregular network. A right isosceles
triangle is bisected at the midpoint v of its hypotenuse ab, where its error is

    e(v) = |z(v) - (z(a) + z(b)) / 2| cos(v),

cos(v) being the angle between normal and view: about the distance between the surfaces. The
triangle on the other side of ab is bisected, too, which may require further bisections. With

    E(v) = max(e(v), E of every vertex whose bisection needs v),

computed from the finest level to the coarsest, {v : E(v) > t} includes all required vertices: there
are no cracks for any t. A vertex at the silhouette has E = infinity. Every other vertex adds two
triangles, so t is an order statistic of E, and the budget is met exactly.

Cost: linear in the pixels.

Citation: P. Lindstrom et al., "Real-time, continuous level of detail rendering of height fields",
SIGGRAPH 1996, doi:10.1145/237170.237217; W. Evans, D. Kirkpatrick, G. Townsend, "Right-triangulated
irregular networks", Algorithmica 30 (2001), doi:10.1007/s00453-001-0006-x.

Limits: e(v) is the error at one point of the two triangles, and E does not bound the others. With a
perspective camera, heights are compared along the pixels' rays. Straight silhouettes have a vertex
at each pixel, too.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .renumbering import renumbered

_ROOT = 64  # cells along a side of the largest squares; a power of two
_HALF = _ROOT // 2
_LEAST_COSINE = 0.05
_MOST_PIXELS = 1 << 17  # approximate number processed at a time


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Triangles over a grid of vertices.

    Attributes
    ----------
    vertices : (V, 2) int64 ndarray
        Row and column of each used vertex.
    faces : (F, 3) int64 ndarray
        Vertices of each triangle, counter-clockwise with rows downward; the right angle is at the
        last one.
    """

    vertices: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class Patch:
    """Triangles of one size and orientation, and the pixels that they cover.

    Attributes
    ----------
    faces : (T, 3) int64 ndarray
        Vertices of each triangle.
    first : (T, 2) int64 ndarray
        Row and column of the first vertex.
    offsets : (P, 2) int64 ndarray
        From there to each pixel in the triangle, including those on its sides.
    weights : (P, 3) float64 ndarray
        Barycentric coordinates of the pixels.
    """

    faces: np.ndarray
    first: np.ndarray
    offsets: np.ndarray
    weights: np.ndarray

    @property
    def pixels(self) -> np.ndarray:
        """Row and column of the pixels (T, P, 2)."""
        return self.first[:, None] + self.offsets

    def flat_pixels(self, width: int) -> np.ndarray:
        """Return the indices of the pixels in a flattened map.

        Parameters
        ----------
        width : int
            Of the map.

        Returns
        -------
        (P, T) int64 ndarray
        """
        return np.add.outer(self.offsets @ (width, 1), self.first @ (width, 1))


def adaptive_triangles(
    height: np.ndarray, cells: np.ndarray, cosine: np.ndarray, budget: int
) -> Triangulation | None:
    """Triangulate the cells of a height map with at most `budget` triangles.

    Parameters
    ----------
    height : (H, W) ndarray
        In units of the distance between vertices.
    cells : (H - 1, W - 1) bool ndarray
        The cells to cover, each between four vertices.
    cosine : (H, W) ndarray
        Of the angle between normal and view.
    budget : int
        0 for only the triangles that the silhouette needs.

    Returns
    -------
    Triangulation or None
        None where the silhouette alone needs more.
    """
    errors = _errors(height, cells, cosine)
    coarse = _leaves(errors, np.inf, cells)
    if budget and len(coarse) > budget:
        return None
    free = errors[np.isfinite(errors) & (errors > 0)]
    more = (budget - len(coarse)) // 2
    if more <= 0 or not len(free):
        return _compact(coarse, errors.shape[1])
    threshold = 0.0 if more >= len(free) else np.partition(free, -more - 1)[-more - 1]
    return _compact(_leaves(errors, float(threshold), cells), errors.shape[1])


def covered_pixels(mesh: Triangulation, stride: int = 1) -> Iterator[Patch]:
    """Iterate over the pixels of all triangles, by the triangles' size and orientation.

    Parameters
    ----------
    mesh : Triangulation
    stride : int
        Pixels from vertex to vertex of the grid.

    Yields
    ------
    Patch
        Rows and columns are those of pixels.
    """
    corners = mesh.vertices[mesh.faces] * stride
    sides = (corners[:, 1:] - corners[:, :1]).reshape(-1, 4)
    count = 2 * int(np.abs(sides).max(initial=0)) + 1
    kinds = sides @ (count**3, count**2, count, 1)
    order = np.argsort(kinds, kind="stable")
    ends = np.flatnonzero(np.diff(kinds[order])) + 1
    for group in np.split(order, ends):
        offsets, weights = _lattice(sides[group[0]].reshape(2, 2))
        for part in np.array_split(group, -(-len(group) * len(offsets) // _MOST_PIXELS)):
            yield Patch(mesh.faces[part], corners[part, 0], offsets, weights)


def _lattice(sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The whole-numbered points (P, 2) of the triangle of 0 and two sides, and their barycentric
    coordinates (P, 3).
    """
    low, high = (bound(np.vstack([np.zeros(2, int), sides]), axis=0) for bound in (np.min, np.max))
    points = np.stack(
        np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high, strict=True)), indexing="ij"),
        -1,
    ).reshape(-1, 2)
    (a, b), (c, d) = sides
    area = a * d - b * c  # integers: points on a side are classified exactly
    second, third = points[:, 0] * d - points[:, 1] * c, points[:, 1] * a - points[:, 0] * b
    weights = np.stack([area - second - third, second, third], -1) * np.sign(area)
    inside = (weights >= 0).all(axis=1)
    return points[inside], weights[inside] / abs(area)


def _errors(height: np.ndarray, cells: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """E of every vertex, float32, on a grid of whole squares of `_ROOT` cells."""
    rows, columns = (_ROOT * -(-(n - 1) // _ROOT) for n in height.shape)
    lattice = _Lattice(rows, columns)
    z, weight, total = (
        np.zeros((rows + 1 + _ROOT, columns + 1 + _ROOT), np.float32) for _ in range(3)
    )
    around = np.zeros(z.shape, np.int8)  # cells to cover around each vertex
    for down in (0, 1):
        for right in (0, 1):
            around[lattice.corner(cells.shape, down, right)] += cells
    used, here = around > 0, lattice.corner(height.shape)
    z[here] = height
    weight[here] = np.where(used[here], np.maximum(cosine, _LEAST_COSINE), 0)
    for row, column in ((0, 1), (1, 0)):  # each unit edge of the silhouette ends at such a vertex
        finest = lattice.every(2, row, column)
        total[finest][used[finest] & (around[finest] < 4)] = np.inf
    half = 1
    while half < _ROOT:
        for row, column in ((0, half), (half, 0)):  # the midpoints of the squares' sides
            ends = lattice.pair(2 * half, row, column, (row, column))
            values = _missed(z, weight, lattice.every(2 * half, row, column), *ends)
            _raise(total, values, lattice, (2 * half, row, column), half // 2, _DIAGONALS)
        values = _missed_in_squares(z, weight, lattice, half)
        _raise(total, values, lattice, (2 * half, half, half), half, _SIDES)
        half *= 2
    return total[lattice.corner((rows + 1, columns + 1))]


_DIAGONALS = ((-1, -1), (-1, 1), (1, -1), (1, 1))
_SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))
Slices = tuple[slice, slice]


@dataclass(frozen=True)
class _Lattice:
    """Vertices at regular distances, as slices of an array with a frame of `_HALF` vertices."""

    rows: int
    columns: int

    def corner(self, shape: tuple[int, ...], down: int = 0, right: int = 0) -> Slices:
        """A block at the upper left corner."""
        top, left = _HALF + down, _HALF + right
        return slice(top, top + shape[0]), slice(left, left + shape[1])

    def every(self, step: int, row: int, column: int, down: int = 0, right: int = 0) -> Slices:
        """The vertices (row + i step, column + j step) of the grid, shifted by (down, right)."""
        return (
            _spaced(_HALF + row + down, step, self.rows // step + (row == 0)),
            _spaced(_HALF + column + right, step, self.columns // step + (column == 0)),
        )

    def pair(self, step: int, row: int, column: int, move: tuple[int, int]) -> list[Slices]:
        """The vertices shifted backward and forward."""
        return [self.every(step, row, column, sign * move[0], sign * move[1]) for sign in (-1, 1)]


def _spaced(start: int, step: int, count: int) -> slice:
    return slice(start, start + (count - 1) * step + 1, step)


def _missed(
    z: np.ndarray, weight: np.ndarray, middle: Slices, first: Slices, second: Slices
) -> np.ndarray:
    """e of the vertices `middle`; 0 where a vertex is not used."""
    error = np.abs(z[middle] - (z[first] + z[second]) / 2) * weight[middle]
    return np.where((weight[first] > 0) & (weight[second] > 0), error, 0)


def _missed_in_squares(
    z: np.ndarray, weight: np.ndarray, lattice: _Lattice, half: int
) -> np.ndarray:
    """e at the centres of squares, whose diagonals alternate like the colours of a chessboard."""
    place = 2 * half, half, half
    one, other = (
        _missed(z, weight, lattice.every(*place), *lattice.pair(*place, diagonal))
        for diagonal in ((half, half), (half, -half))
    )
    even = np.add.outer(*(np.arange(n) for n in one.shape)) % 2 == 0
    return np.where(even, one, other)


def _raise(
    total: np.ndarray,
    values: np.ndarray,
    lattice: _Lattice,
    place: tuple[int, int, int],
    distance: int,
    directions: tuple[tuple[int, int], ...],
) -> None:
    """Set E at a lattice to the largest of e and the E of its neighbours of the level below."""
    here = lattice.every(*place)
    total[here] = np.maximum(total[here], values)
    for down, right in directions if distance else ():
        neighbours = lattice.every(*place, down * distance, right * distance)
        total[here] = np.maximum(total[here], total[neighbours])


def _leaves(errors: np.ndarray, threshold: float, cells: np.ndarray) -> np.ndarray:
    """The triangles (F, 3) of the mesh, as flat vertices: those at whose midpoints E is at most
    `threshold`.
    """
    width = errors.shape[1]
    split = errors.reshape(-1) > threshold if np.isfinite(threshold) else np.isinf(errors.ravel())
    triangles, done = _roots(errors.shape), []
    for _ in range(2 * _ROOT.bit_length() - 2):
        a, b, c = triangles.T
        middle = (a + b) // 2
        bisected = split[middle]
        done.append(triangles[~bisected])
        a, b, c, middle = (part[bisected] for part in (a, b, c, middle))
        triangles = np.concatenate([np.stack([c, a, middle], -1), np.stack([b, c, middle], -1)])
    found = np.concatenate([*done, triangles])
    # One cell inside a triangle decides for all of its cells.
    row, column = (part.sum(axis=1) // 3 for part in np.divmod(found, width))
    inside = (row < cells.shape[0]) & (column < cells.shape[1])
    inside[inside] = cells[row[inside], column[inside]]
    return found[inside]


def _roots(shape: tuple[int, ...]) -> np.ndarray:
    """Two triangles (a, b, c) for each of the largest squares, right-angled at c."""
    i, j = (part.reshape(-1) for part in np.indices([n // _ROOT for n in shape]))
    top, left = i * _ROOT, j * _ROOT
    upper_left, upper_right = top * shape[1] + left, top * shape[1] + left + _ROOT
    lower_left, lower_right = upper_left + _ROOT * shape[1], upper_right + _ROOT * shape[1]
    even = (i + j) % 2 == 0
    a, b = np.where(even, upper_left, upper_right), np.where(even, lower_right, lower_left)
    c, d = np.where(even, lower_left, upper_left), np.where(even, upper_right, lower_right)
    return np.concatenate([np.stack([b, a, c], -1), np.stack([a, b, d], -1)])


def _compact(triangles: np.ndarray, width: int) -> Triangulation:
    used, faces = renumbered(triangles)
    return Triangulation(np.stack(np.divmod(used, width), -1), faces)
