"""Triangle meshes with smooth normals and texture coordinates, among them closed surfaces swept
around the y axis.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh.

    Attributes
    ----------
    vertices : (N, 3) ndarray
        Object units, y up.
    normals : (N, 3) ndarray
        Unit, outward.
    uv : (N, 2) ndarray
        Texture coordinates in [0, 1].
    faces : (M, 3) ndarray of int
        Vertex indices, counter-clockwise from outside.
    """

    vertices: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    faces: np.ndarray

    def turned(self, degrees_x: float) -> "Mesh":
        """Return the mesh rotated about the x axis.

        Parameters
        ----------
        degrees_x : float
            Angle in degrees; a positive one tips the top toward the viewer (+z).

        Returns
        -------
        Mesh
            The rotated mesh.
        """
        c, s = np.cos(np.radians(degrees_x)), np.sin(np.radians(degrees_x))
        return self.rotated(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]))

    def rotated(self, rotation: np.ndarray) -> "Mesh":
        """Return the mesh rotated by a matrix.

        Parameters
        ----------
        rotation : (3, 3) ndarray
            Rotation matrix, applied to column vectors.

        Returns
        -------
        Mesh
            The rotated mesh.
        """
        return Mesh(self.vertices @ rotation.T, self.normals @ rotation.T, self.uv, self.faces)

    def fitted(self) -> "Mesh":
        """Return the mesh centred by its bounding box, the larger of its x and y extents
        scaled to 2.
        """
        low, high = self.vertices.min(0), self.vertices.max(0)
        scale = 2 / (high - low)[:2].max()
        return Mesh((self.vertices - (low + high) / 2) * scale, self.normals, self.uv, self.faces)


def swept(points: np.ndarray) -> Mesh:
    """Make a mesh of a closed surface on a grid.

    Parameters
    ----------
    points : (rows, columns, 3) ndarray
        Row 0 at the top pole, the last at the bottom one; columns go around once, counter-clockwise
        from above, and the last repeats the first.

    Returns
    -------
    Mesh
        `u` runs with the columns, `v` from 0 at the top to 1.
    """
    rows, columns = points.shape[:2]
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    uv = np.stack([u.ravel(), v.ravel()], -1)
    return Mesh(
        points.reshape(-1, 3), _grid_normals(points).reshape(-1, 3), uv, grid_faces(rows, columns)
    )


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """Return the triangles of a grid of vertices.

    Parameters
    ----------
    rows, columns : int
        Size of the grid, in row order.

    Returns
    -------
    (M, 3) ndarray of int
        Counter-clockwise if rows run down and columns to the right.
    """
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (
        corner[:-1, :-1].ravel(),
        corner[1:, :-1].ravel(),
        corner[1:, 1:].ravel(),
        corner[:-1, 1:].ravel(),
    )
    return np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return vertex normals from adjacent faces.

    Each face is weighted by sin(angle) / (product of the sides) at the vertex, which is exact for
    vertices on a sphere (N. Max 1999, doi:10.1080/10867651.1999.10487501).

    Parameters
    ----------
    vertices : (N, 3) ndarray
        Positions; vertices at the same position must be merged, or they form a crease.
    faces : (M, 3) ndarray of int
        Triangles.

    Returns
    -------
    (N, 3) ndarray
        Unit normals; (0, 0, 1) for vertices without faces.
    """
    corner = vertices[faces]
    sides = corner - np.roll(corner, 1, axis=1)
    square = (sides**2).sum(-1)
    across = np.cross(sides[:, 1], sides[:, 2])
    product = square * np.roll(square, -1, axis=1)  # of the two sides at each corner
    weights = (across[:, None] / np.where(product > 0, product, np.inf)[..., None]).reshape(-1, 3)
    total = np.stack(
        [np.bincount(faces.ravel(), weights[:, i], len(vertices)) for i in range(3)], -1
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 0, total / np.where(length > 0, length, 1), (0.0, 0.0, 1.0))


def joined(first: Mesh, second: Mesh) -> Mesh:
    """Concatenate two meshes.

    Parameters
    ----------
    first, second : Mesh
        The meshes.

    Returns
    -------
    Mesh
        Where they overlap, both surfaces are kept.
    """
    vertices, normals, uv = (
        np.concatenate([getattr(mesh, part) for mesh in (first, second)])
        for part in ("vertices", "normals", "uv")
    )
    return Mesh(
        vertices, normals, uv, np.concatenate([first.faces, second.faces + len(first.vertices)])
    )


def _grid_normals(points: np.ndarray) -> np.ndarray:
    """Outward unit normals of a swept grid, by central differences across the seam."""
    ring = points[:, :-1]
    around = np.roll(ring, -1, axis=1) - np.roll(ring, 1, axis=1)
    normals = np.cross(np.gradient(ring, axis=0), around)
    normals[0], normals[-1] = (0, 1, 0), (0, -1, 0)  # the poles, where the cross product vanishes
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.concatenate([normals, normals[:, :1]], axis=1)


def write_ply(path: Path, mesh: Mesh) -> None:
    """Write a binary PLY file with normals and texture coordinates, in Mitsuba's layout.

    Parameters
    ----------
    path : Path
        The file.
    mesh : Mesh
        The mesh.
    """
    names = ["x", "y", "z", "nx", "ny", "nz", "u", "v"]
    table = np.hstack([mesh.vertices, mesh.normals, mesh.uv]).astype("<f4")
    triangles = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"] = 3
    triangles["corners"] = mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(table)}",
        *(f"property float {n}" for n in names),
    ]
    header += [
        f"element face {len(triangles)}",
        "property list uchar int vertex_indices",
        "end_header",
        "",
    ]
    path.write_bytes("\n".join(header).encode() + table.tobytes() + triangles.tobytes())
