"""Intersections of rays with one mesh, in any variant of Mitsuba: nearest hits and occlusion.

The CUDA and LLVM variants trace whole arrays of rays at once; `scalar_rgb` traces them one by one,
at some millions per second.

Limits: positions are computed in float32, to about 1e-6 of the object. Rays that start on the
surface are lifted off it by `LIFT`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from .meshes import Mesh, write_ply
from .variant import load_mitsuba

# In object units; objects are about 2 wide.
LIFT = 2e-4
_VECTOR = 64  # bytes


@dataclass(frozen=True, eq=False)
class Hits:
    """The nearest hit of each of M rays. All values are 0 for rays that miss.

    Attributes
    ----------
    valid : (M,) ndarray of bool
        Whether the ray hits.
    position : (M, 3) ndarray
        Object units.
    normal : (M, 3) ndarray
        Unit, interpolated between vertices, turned toward the ray's origin.
    uv : (M, 2) ndarray
        Texture coordinates.
    front : (M,) ndarray of bool
        Whether the ray meets the side from which the corners of the face are counter-clockwise.
    """

    valid: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    uv: np.ndarray
    front: np.ndarray


class Tracer:
    """A mesh, ready for ray tracing.

    Parameters
    ----------
    mesh : Mesh
        The mesh.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """

    def __init__(self, mesh: Mesh) -> None:
        mi = load_mitsuba()
        with TemporaryDirectory() as folder:
            ply = Path(folder) / "object.ply"
            write_ply(ply, mesh)
            self.shape = mi.load_dict({"type": "ply", "filename": str(ply)})
        self.scene = mi.load_dict({"type": "scene", "object": self.shape})
        self._scalar = mi.variant().startswith("scalar")

    def hits(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        """Return the nearest hits of rays.

        Parameters
        ----------
        origins, directions : (M, 3) ndarray
            Origins and unit directions.

        Returns
        -------
        Hits
            One entry per ray.
        """
        if not len(origins):  # Dr.Jit aborts the process on empty arrays
            none, vectors = np.zeros(0, bool), np.zeros((0, 3))
            return Hits(none, vectors, vectors, np.zeros((0, 2)), none)
        columns = (
            self._scalar_hits(origins, directions)
            if self._scalar
            else self._array_hits(origins, directions)
        )
        valid = columns[:, 0] > 0
        normal = columns[:, 4:7]
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = normal / np.where(length > 0, length, 1)
        normal = np.where((normal * directions).sum(1, keepdims=True) > 0, -normal, normal)
        front = np.einsum("mk,mk->m", columns[:, 9:], directions) < 0
        return Hits(valid, columns[:, 1:4], normal, columns[:, 7:9], front)

    def blocked(
        self, origins: np.ndarray, directions: np.ndarray, distances: np.ndarray | float
    ) -> np.ndarray:
        """Test whether rays are blocked.

        Parameters
        ----------
        origins, directions : (M, 3) ndarray
            Origins and unit directions.
        distances : (M,) ndarray or float
            Length of the rays, infinite for distant lights.

        Returns
        -------
        (M,) ndarray of bool
            True where the mesh is hit within the distance.
        """
        if not len(origins):
            return np.zeros(0, bool)
        mi = load_mitsuba()
        reach = np.broadcast_to(np.minimum(distances, 1e6), (len(origins),)).astype(np.float32)
        if self._scalar:
            test, ray = self.scene.ray_test, mi.Ray3f
            rays = zip(_rows(origins), _rows(directions), reach.tolist(), strict=True)
            return np.fromiter(
                (test(ray(o, d, r, 0.0, [])) for o, d, r in rays), bool, len(origins)
            )
        rays = mi.Ray3f(_points(origins), _vectors(directions))
        rays.maxt = mi.Float(reach)
        return np.array(self.scene.ray_test(rays), dtype=bool)

    def _array_hits(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        mi = load_mitsuba()
        import drjit

        hit = self.scene.ray_intersect(mi.Ray3f(_points(origins), _vectors(directions)))
        # Component by component: the conversion of a whole vector is a kernel that is compiled anew
        # for every number of rays.
        parts = [hit.is_valid(), *hit.p, *hit.sh_frame.n, *hit.uv, *hit.n]
        drjit.eval(parts)
        columns = np.stack([np.array(part, dtype=float) for part in parts], axis=1)
        return columns * columns[:, :1]

    def _scalar_hits(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        mi = load_mitsuba()
        columns = np.zeros((len(origins), 12))
        for row, (origin, direction) in enumerate(
            zip(_rows(origins), _rows(directions), strict=True)
        ):
            hit = self.scene.ray_intersect(mi.Ray3f(origin, direction))
            if hit.is_valid():
                columns[row] = (1, *hit.p, *hit.sh_frame.n, *hit.uv, *hit.n)
        return columns


def _rows(values: np.ndarray) -> Iterator[tuple[float, ...]]:
    """The rows of (M, 3) one by one, as tuples: as many lists would slow down the garbage
    collector.
    """
    return zip(*values.T.tolist(), strict=True)


def _points(values: np.ndarray) -> object:
    return load_mitsuba().Point3f(*_parts(values))


def _vectors(values: np.ndarray) -> object:
    return load_mitsuba().Vector3f(*_parts(values))


def _parts(values: np.ndarray) -> list[object]:
    return [lanes(part) for part in values.T]


def lanes(values: np.ndarray) -> Any:
    """Convert numbers to a Dr.Jit array, in a CUDA or LLVM variant.

    An LLVM variant reads the numbers in place, and its kernels depend on whether their address is a
    multiple of the vector length: here it always is, so that no kernel is compiled twice.

    Parameters
    ----------
    values : (N,) ndarray
        The numbers.

    Returns
    -------
    Dr.Jit array
        N lanes, float32.

    Raises
    ------
    InputError
        If Mitsuba is not installed.
    """
    room = np.empty(values.size + _VECTOR // 4, np.float32)
    start = -room.ctypes.data % _VECTOR // 4
    aligned = room[start : start + values.size]
    aligned[:] = values
    return load_mitsuba().Float(aligned)
