"""Bodies blended from balls, limbs and ellipsoids, as triangles of an implicit function.

Equation: a primitive's distance d to a point is, for a limb from a to b with radii r, s, the
distance to the nearest point of the segment minus the radius there; for an ellipsoid with axes e,
about |x / e| (|x / e| - 1) / |x / e^2|. Primitives are joined by -log(sum exp(-d / blend)) blend,
which rounds their joints by about `blend`, and holes are cut by max(d, -hole). The zero set is
triangulated by naive surface nets: one vertex a cell that the surface crosses, at the mean of the
crossings of its edges, and one quadrilateral an edge that it crosses.

Citation: S. F. Gibson 1998, doi:10.1007/BFb0056277 (surface nets).

Limits: CELLS cells along the longest side; details below a cell are lost. Sharp edges are blunt.
"""

from dataclasses import dataclass

import numpy as np

from .surface import Surface

CELLS = 72
_FAR = 12.0  # in units of `blend`: what is farther away does not count


@dataclass(frozen=True)
class Limb:
    """A round cone.

    Attributes
    ----------
    start, end : tuple of float
        Ends of its axis.
    radius, end_radius : float
        Radii at the ends.
    """

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float
    end_radius: float

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance to points.

        Parameters
        ----------
        points : (..., 3) ndarray
            Places.

        Returns
        -------
        (...) ndarray
            Distances, negative inside.
        """
        start, axis = np.array(self.start), np.subtract(self.end, self.start)
        away = points - start
        along = np.clip(away @ axis / max(float(axis @ axis), 1e-12), 0, 1)
        nearest = np.linalg.norm(away - along[..., None] * axis, axis=-1)
        return np.asarray(nearest - self.radius - along * (self.end_radius - self.radius))

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the bounding box."""
        ends, radii = np.array([self.start, self.end]), np.array([self.radius, self.end_radius])
        return (ends - radii[:, None]).min(0), (ends + radii[:, None]).max(0)


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid.

    Attributes
    ----------
    centre : tuple of float
        Its centre.
    axes : tuple of float
        Half axes.
    """

    centre: tuple[float, float, float]
    axes: tuple[float, float, float]

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return about the distance to points.

        Parameters
        ----------
        points : (..., 3) ndarray
            Places.

        Returns
        -------
        (...) ndarray
            Distances, negative inside.
        """
        away = (points - np.array(self.centre)) / np.array(self.axes)
        place = np.linalg.norm(away, axis=-1)
        slope = np.linalg.norm(away / np.array(self.axes), axis=-1)
        return np.asarray(place * (place - 1) / np.maximum(slope, 1e-9))

    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the bounding box."""
        return np.subtract(self.centre, self.axes), np.add(self.centre, self.axes)


Primitive = Limb | Ellipsoid


def blended(
    primitives: list[Primitive],
    blend: float,
    holes: list[Primitive] | None = None,
    cells: int = CELLS,
) -> Surface:
    """Triangulate a blend of primitives.

    Parameters
    ----------
    primitives : list of Limb or Ellipsoid
        At least one.
    blend : float
        Rounding of the joints, in units of length.
    holes : list of Limb or Ellipsoid, optional
        Cut out.
    cells : int, optional
        Cells along the longest side.

    Returns
    -------
    Surface
        Closed.
    """
    boxes = [one.box() for one in primitives]
    low = np.min([box[0] for box in boxes], axis=0) - 2 * blend
    high = np.max([box[1] for box in boxes], axis=0) + 2 * blend
    step = float((high - low).max()) / cells
    counts = np.ceil((high - low) / step).astype(int) + 1
    axes = [low[k] + step * np.arange(counts[k]) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    total = np.zeros(points.shape[:3])
    for one in primitives:
        near = _window(axes, one.box(), _FAR * blend)
        total[near] += np.exp(np.clip(-one.distance(points[near]) / blend, -60, 60))
    field = -blend * np.log(np.maximum(total, np.exp(-60)))
    for hole in holes or []:
        near = _window(axes, hole.box(), 2 * step)
        field[near] = np.maximum(field[near], -hole.distance(points[near]))
    nets = surface_nets(field)
    return Surface(low + step * nets.vertices, nets.faces)


def surface_nets(field: np.ndarray) -> Surface:
    """Triangulate the zero set of a function on a grid.

    Parameters
    ----------
    field : (a, b, c) ndarray
        Values, negative inside; positive at the border.

    Returns
    -------
    Surface
        Vertices in units of the grid.
    """
    inside = field < 0
    shape = np.array(field.shape) - 1
    total, count = np.zeros((*shape, 3)), np.zeros(shape)
    crossings = []
    for axis in range(3):
        low = tuple(slice(0, -1) if k == axis else slice(None) for k in range(3))
        high = tuple(slice(1, None) if k == axis else slice(None) for k in range(3))
        at = np.argwhere(inside[low] != inside[high])
        first = field[tuple(at.T)]
        place = at.astype(float)
        place[:, axis] += first / (first - field[tuple((at + np.eye(3, dtype=int)[axis]).T)])
        u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
        around = [at - u - v, at - v, at, at - u]  # counter-clockwise about the axis
        for cell in around:
            np.add.at(total, tuple(cell.T), place)
            np.add.at(count, tuple(cell.T), 1)
        crossings.append((np.stack(around, 1), first < 0))
    number = np.cumsum(count > 0).reshape(count.shape) - 1
    vertices = total[count > 0] / count[count > 0][:, None]
    faces = []
    for around, outward in crossings:
        a, b, c, d = number[tuple(np.moveaxis(around, -1, 0))].T
        corners = np.stack([a, b, c, a, c, d], -1).reshape(-1, 2, 3)
        corners[~outward] = corners[~outward][..., ::-1]
        faces.append(corners.reshape(-1, 3))
    return Surface(vertices, np.concatenate(faces))


def _window(
    axes: list[np.ndarray], box: tuple[np.ndarray, np.ndarray], margin: float
) -> tuple[slice, slice, slice]:
    """The part of the grid within a margin of a box."""
    ends = [np.searchsorted(axes[k], (box[0][k] - margin, box[1][k] + margin)) for k in range(3)]
    i, j, k = (slice(int(first), int(last)) for first, last in ends)
    return i, j, k
