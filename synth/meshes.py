"""Closed surfaces swept around the y axis, as triangle meshes with smooth normals and texture coordinates."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Mesh:
    """`vertices`, `normals`: (N, 3) float, object units, y up, normals outward. `uv`: (N, 2) in [0, 1]. `faces`: (M, 3) int."""

    vertices: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    faces: np.ndarray

    def turned(self, degrees_x: float) -> "Mesh":
        """The mesh turned about the x axis; a positive angle tips its top toward the viewer (+z)."""
        c, s = np.cos(np.radians(degrees_x)), np.sin(np.radians(degrees_x))
        turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        return Mesh(self.vertices @ turn.T, self.normals @ turn.T, self.uv, self.faces)


def swept(points: np.ndarray) -> Mesh:
    """The mesh of a closed surface given on a grid.

    `points`: (rows, columns, 3), row 0 at the top pole and the last at the bottom one; the columns go around once, counter-clockwise
    seen from above, and the last repeats the first. `u` runs with the columns, `v` from 0 at the top to 1, as a
    texture's rows do.
    """
    rows, columns = points.shape[:2]
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel(), corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return Mesh(points.reshape(-1, 3), _grid_normals(points).reshape(-1, 3), np.stack([u.ravel(), v.ravel()], -1), faces)


def _grid_normals(points: np.ndarray) -> np.ndarray:
    """Outward unit normals of a swept grid, by central differences that wrap around the seam."""
    ring = points[:, :-1]
    around = np.roll(ring, -1, axis=1) - np.roll(ring, 1, axis=1)
    normals = np.cross(np.gradient(ring, axis=0), around)
    normals[0], normals[-1] = (0, 1, 0), (0, -1, 0)  # the poles, where the cross product vanishes
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.concatenate([normals, normals[:, :1]], axis=1)


def write_ply(path: Path, mesh: Mesh) -> None:
    """Writes a binary PLY file with normals and texture coordinates, as Mitsuba reads it."""
    names = ["x", "y", "z", "nx", "ny", "nz", "u", "v"]
    table = np.hstack([mesh.vertices, mesh.normals, mesh.uv]).astype("<f4")
    triangles = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"] = 3
    triangles["corners"] = mesh.faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}", *(f"property float {n}" for n in names)]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(header).encode() + table.tobytes() + triangles.tobytes())
