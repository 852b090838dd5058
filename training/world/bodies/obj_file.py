"""Triangles and named objects of Wavefront OBJ files.

Equation: `v` lines are vertices, `f` lines polygons of vertex numbers (from 1; negative ones count
back from the last vertex), cut into triangles as fans. Each `o` or `g` line begins a named object.

Citation: Wavefront Technologies, "Object files (.obj)", Advanced Visualizer manual, appendix B1.

Limits: texture coordinates, normals, materials, curves and line continuations are ignored. Fans are
right for convex polygons.
"""

import numpy as np

from isc_core.errors import InputError

from .geometry.surface import Surface


def read_obj(data: bytes, name: str) -> tuple[Surface, np.ndarray]:
    """Read the triangles of an OBJ file.

    Parameters
    ----------
    data : bytes
        Content of the file.
    name : str
        For messages.

    Returns
    -------
    surface : Surface
        All triangles; none is an empty (0, 3) array.
    objects : (M,) ndarray of int
        Number of the named object of each triangle.

    Raises
    ------
    InputError
        If a number cannot be read, or a face names a vertex that does not exist.
    """
    try:
        vertices, faces, objects = _parsed(data.decode("latin-1"))
    except (ValueError, IndexError) as error:
        raise InputError(f"{name} is not a readable OBJ file: export the mesh again") from error
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise InputError(f"{name} has faces on vertices that do not exist: export the mesh again")
    return Surface(vertices, faces), objects


def _parsed(text: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (N, 3), triangles (M, 3) from 0, and the object (M,) of each triangle."""
    points: list[list[str]] = []
    triangles: list[tuple[int, int, int]] = []
    objects: list[int] = []
    number = 0
    for line in text.splitlines():
        if line.startswith("v "):
            points.append(line.split()[1:4])
        elif line.startswith("f "):
            corners = [int(corner.split("/")[0]) for corner in line.split()[1:]]
            corners = [k - 1 if k > 0 else len(points) + k for k in corners]
            fan = zip(corners[1:-1], corners[2:], strict=True)
            triangles += [(corners[0], second, third) for second, third in fan]
            objects += [number] * (len(corners) - 2)
        elif line.startswith(("o ", "g ")):
            number += 1
    return (
        np.array(points, float).reshape(-1, 3),
        np.array(triangles, int).reshape(-1, 3),
        np.array(objects, int),
    )
