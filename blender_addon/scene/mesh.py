"""The height mesh: vertices, faces, UV, the recovered normals, and how far each vertex can be
trusted.

Axes: the camera's frame (x right, y up, z toward the viewer) becomes Blender's (x, -z, y); metres.
The recovered normals are "free" custom normals, a vector a vertex: exact, and not turned when the
mesh is deformed (Mesh > Normals > Clear Custom Split Normals then gives those of the geometry).
Attributes a vertex: `confidence` in [0, 1].
"""

from dataclasses import dataclass

import bpy
import numpy as np

from isc_core.errors import InputError

from ..files.result_arrays import Result

UV, NORMAL, CONFIDENCE = "UVMap", "custom_normal", "confidence"


@dataclass(frozen=True)
class Geometry:
    """A mesh in Blender's axes: `vertices` (V, 3) metres; `corners` (L,) int32, the vertex of each
    corner, and `starts` (F,) int32, the first corner of each face; `uv` (V, 2) and `confidence`
    (V,) a vertex; `normals` (V, 3) a vertex or (L, 3) a corner, None for smooth.
    """

    vertices: np.ndarray
    corners: np.ndarray
    starts: np.ndarray
    uv: np.ndarray
    confidence: np.ndarray
    normals: np.ndarray | None


def to_blender(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of the camera's frame in Blender's axes."""
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], -1)


def sheet(result: Result, size_metres: float) -> Geometry:
    """The visible side of the object; `size_metres`: its longer side."""
    scale = metres_per_pixel(result, size_metres) / result.metres_per_pixel
    corners = np.ascontiguousarray(result.faces.ravel())
    rows, columns = result.vertex_pixel.T
    vertices = to_blender(result.vertices.astype(np.float64) * scale)
    starts = np.arange(0, len(corners), 3, dtype=np.int32)
    return Geometry(
        vertices,
        corners,
        starts,
        result.uv,
        result.confidence[rows, columns],
        to_blender(result.vertex_normals),
    )


def metres_per_pixel(result: Result, size_metres: float) -> float:
    """Metres of one pixel of the maps. Raises `InputError` if the size is not positive."""
    if not 0 < size_metres < 1e6:
        raise InputError(f"a size of {size_metres} metres cannot be built: give one above 0")
    return size_metres / result.longest_side


def fill_mesh(mesh: bpy.types.Mesh, geometry: Geometry) -> None:
    """Replaces the mesh's geometry, its UV, normals and attributes; its materials stay."""
    mesh.clear_geometry()
    mesh.vertices.add(len(geometry.vertices))
    mesh.loops.add(len(geometry.corners))
    mesh.polygons.add(len(geometry.starts))
    mesh.vertices.foreach_set("co", _flat(geometry.vertices))
    mesh.loops.foreach_set("vertex_index", geometry.corners)
    mesh.polygons.foreach_set("loop_start", geometry.starts)
    mesh.update(calc_edges=True)
    mesh.uv_layers.new(name=UV, do_init=False).uv.foreach_set(
        "vector", _flat(geometry.uv[geometry.corners])
    )
    trust = mesh.attributes.new(CONFIDENCE, "FLOAT", "POINT")
    trust.data.foreach_set("value", _flat(geometry.confidence))
    if geometry.normals is not None:
        domain = "POINT" if len(geometry.normals) == len(geometry.vertices) else "CORNER"
        mesh.attributes.new(NORMAL, "FLOAT_VECTOR", domain).data.foreach_set(
            "vector", _flat(geometry.normals)
        )


def _flat(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, np.float32).ravel()
