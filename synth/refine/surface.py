"""The visible surface of a result, which blocks light and reflects it.

Equation: the points of the mask's pixels, about 2 wide, in triangles. The texture coordinates of a
point are its place in the frame of the maps, so that a ray finds the pixel that it meets. Points
that receive light start `_LIFT` pixels above the surface.

Limits: steps of the height become walls, lit by what their pixels show.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.errors import InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.refinement.working_scale import WorkingScale
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.part_of_result import ResultPart
from isc_core.shading.perspective import lifted_points, object_axis

from ..scene.meshes import Mesh
from ..scene.tracing import Tracer

_LIFT = 1.0  # pixels of the scale of the points


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """N points that receive light.

    Attributes
    ----------
    lifted : (N, 3) ndarray
        Where rays start, units of the surface.
    normal : (N, 3) ndarray
        Unit.
    """

    lifted: np.ndarray
    normal: np.ndarray

    def __getitem__(self, part: slice) -> "SurfacePoints":
        return SurfacePoints(self.lifted[part], self.normal[part])

    def __len__(self) -> int:
        return len(self.normal)


class Surface:
    """The visible surface of a result.

    Parameters
    ----------
    d : Decomposition
        Its height defines the surface, its normals the shading, its diffuse layer the radiance.
    part : FramePart, optional
        The part of the frame that its maps are of; by default all of it.

    Raises
    ------
    InputError
        If Mitsuba is missing, or the mask has no block of 2 x 2 pixels for a surface.
    """

    def __init__(self, d: Decomposition, part: FramePart | None = None) -> None:
        self._d = d
        frame = ResultPart.of(d, part).part
        self._corner, self._size = np.array(frame.corner), np.array(frame.shape[::-1])
        self._position = _positions(d)
        place = np.stack(np.nonzero(d.mask)[::-1], axis=1) + self._corner + 0.5
        self._normal = d.normal[d.mask].astype(float)
        mesh = Mesh(self._position, self._normal, place / self._size, _triangles(d.mask))
        self.tracer = Tracer(mesh)
        wide = max(int(np.ptp(where)) for where in np.nonzero(d.mask)) + 1
        self._lift = _LIFT * float(np.ptp(self._position[:, :2], axis=0).max()) / wide

    def points(self) -> SurfacePoints:
        """Return the points of the mask's pixels, row by row."""
        return SurfacePoints(self._position + self._lift * self._normal, self._normal)

    def points_at(self, scale: WorkingScale) -> SurfacePoints:
        """Return the points of the pixels of a working scale, row by row.

        Parameters
        ----------
        scale : WorkingScale
            Of the same result.

        Returns
        -------
        SurfacePoints
            Means of the points and normals of blocks.
        """
        if scale.step == 1:
            return self.points()
        shape = (*self._d.mask.shape, 3)
        maps = np.zeros(shape), np.zeros(shape)
        maps[0][self._d.mask], maps[1][self._d.mask] = self._position, self._normal
        position, normal = (scale.reduced(m, self._d.mask)[scale.mask] for m in maps)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        return SurfacePoints(position + scale.step * self._lift * normal, normal)

    def radiance(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return the radiance that arrives along rays from the surface.

        Parameters
        ----------
        origins, directions : (M, 3) ndarray
            Origins and unit directions.

        Returns
        -------
        (M, 3) ndarray
            The diffuse layer of the pixel that a ray meets, 0 where it meets none or the back.
        """
        d, hits = self._d, self.tracer.hits(origins, directions)
        pixel = (hits.uv * self._size).astype(int) - self._corner
        column, row = np.clip(pixel, 0, np.array(d.mask.shape[::-1]) - 1).T
        seen = hits.valid & hits.front & d.mask[row, column]
        return np.where(seen[:, None], d.diffuse[row, column], 0)


def _positions(d: Decomposition) -> np.ndarray:
    """Points (N, 3) of the mask's pixels, about 2 wide."""
    if d.camera is None:
        rows, columns = np.indices(d.mask.shape)
        points = np.stack([columns, -rows, d.height], axis=-1)[d.mask].astype(float)
    else:
        points = lifted_points(d.height, d.camera, object_axis(d.camera, d.mask))[d.mask]
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray((points - (low + high) / 2) * (2 / max(float((high - low)[:2].max()), 1e-9)))


def _triangles(mask: np.ndarray) -> np.ndarray:
    """Triangles (M, 3) between the mask's pixels, counted row by row."""
    number = np.full(mask.shape, -1)
    number[mask] = np.arange(np.count_nonzero(mask))
    a, b, c, e = number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]
    faces = np.concatenate(
        [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (c, b, e))]
    )
    faces = faces[(faces >= 0).all(axis=1)]
    if not len(faces):
        raise InputError(
            "the mask holds no block of 2 x 2 pixels to cast a shadow: decompose a larger region"
        )
    return faces
