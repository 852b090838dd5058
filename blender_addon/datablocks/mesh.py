"""The height mesh: vertices, faces, UV, the recovered normals, and a confidence per vertex.

Axes: the camera frame (x right, y up, z toward the viewer) becomes Blender's (x, -z, y), in metres.
The recovered normals are stored as "free" custom normals, one vector per vertex: exact, and not
rotated when the mesh is deformed (Mesh > Normals > Clear Custom Split Normals then restores those
of the geometry). The attribute `confidence` of each vertex is in [0, 1].
"""

from dataclasses import dataclass

import bpy
import numpy as np

from isc_core.errors import InputError

from ..files.result_arrays import ResultArrays

UV, NORMAL, CONFIDENCE = "UVMap", "custom_normal", "confidence"


@dataclass(frozen=True)
class MeshGeometry:
    """A mesh in Blender's axes.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        Metres.
    corners : (L,) ndarray of int32
        Vertex of each corner.
    starts : (F,) ndarray of int32
        First corner of each face.
    uv : (V, 2) ndarray
        Texture coordinates.
    confidence : (V,) ndarray
        Confidence in [0, 1].
    normals : (V, 3) or (L, 3) ndarray or None
        Unit normals per vertex or per corner; None for smooth shading.
    """

    vertices: np.ndarray
    corners: np.ndarray
    starts: np.ndarray
    uv: np.ndarray
    confidence: np.ndarray
    normals: np.ndarray | None


def to_blender(vectors: np.ndarray) -> np.ndarray:
    """Convert vectors of the camera frame to Blender's axes.

    Parameters
    ----------
    vectors : (..., 3) ndarray
        Camera frame: x right, y up, z toward the viewer.

    Returns
    -------
    (..., 3) ndarray
        Blender's axes: x right, y away from the viewer, z up.
    """
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], -1)


def front_geometry(result: ResultArrays, size_metres: float) -> MeshGeometry:
    """Return the visible side of the object, an open mesh.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.

    Returns
    -------
    MeshGeometry
        Triangles with a normal per vertex.
    """
    scale = metres_per_pixel(result, size_metres) / result.metres_per_pixel
    corners = np.ascontiguousarray(result.faces.ravel())
    rows, columns = result.vertex_pixel.T
    return MeshGeometry(
        vertices=to_blender(result.vertices.astype(np.float64) * scale),
        corners=corners,
        starts=np.arange(0, len(corners), 3, dtype=np.int32),
        uv=result.uv,
        confidence=result.confidence[rows, columns],
        normals=to_blender(result.vertex_normals),
    )


def metres_per_pixel(result: ResultArrays, size_metres: float) -> float:
    """Return the size of a map pixel in the scene.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.

    Returns
    -------
    float
        Metres per pixel.

    Raises
    ------
    InputError
        If the size is not positive.
    """
    if not 0 < size_metres < 1e6:
        raise InputError(f"a size of {size_metres} metres cannot be built: choose one above 0")
    return size_metres / result.longest_side


def fill_mesh(mesh: bpy.types.Mesh, geometry: MeshGeometry) -> None:
    """Replace the geometry, UV, normals and attributes of a mesh; its materials stay.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh.
    geometry : MeshGeometry
        The new geometry.
    """
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
    confidence = mesh.attributes.new(CONFIDENCE, "FLOAT", "POINT")
    confidence.data.foreach_set("value", _flat(geometry.confidence))
    if geometry.normals is not None:
        domain = "POINT" if len(geometry.normals) == len(geometry.vertices) else "CORNER"
        mesh.attributes.new(NORMAL, "FLOAT_VECTOR", domain).data.foreach_set(
            "vector", _flat(geometry.normals)
        )


def _flat(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, np.float32).ravel()
