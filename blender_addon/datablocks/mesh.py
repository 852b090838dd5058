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


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """A mesh in the layout of Blender's attributes, so that it is filled in milliseconds.

    Attributes
    ----------
    positions : (3 V,) ndarray of float32
        Metres.
    corners, corner_edges : (L,) ndarray of int32
        Vertex and edge of each corner.
    starts : (F,) ndarray of int32
        First corner of each face.
    edges : (2 E,) ndarray of int32
        Vertices of each edge.
    uv : (2 L,) ndarray of float32
        Texture coordinates of the corners.
    confidence : (V,) ndarray of float32
        Confidence in [0, 1].
    normals : (3 V,) or (3 L,) ndarray of float32, or None
        Unit normals per vertex or per corner; None for smooth shading.
    """

    positions: np.ndarray
    corners: np.ndarray
    corner_edges: np.ndarray
    starts: np.ndarray
    edges: np.ndarray
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
        raise InputError(
            f"a size of {size_metres} metres is not possible: choose one above 0 and below 1e6"
        )
    return size_metres / result.longest_side


def mesh_arrays(geometry: MeshGeometry) -> MeshArrays:
    """Return a mesh as Blender stores it; this may run in another thread.

    Parameters
    ----------
    geometry : MeshGeometry
        The mesh.

    Returns
    -------
    MeshArrays
        Its arrays.
    """
    corners, starts = geometry.corners.astype(np.int32), geometry.starts.astype(np.int32)
    following = np.arange(1, len(corners) + 1)
    following[np.append(starts[1:], len(corners)) - 1] = starts
    ends = corners[following]
    low, high = np.minimum(corners, ends).astype(np.int64), np.maximum(corners, ends)
    count = len(geometry.vertices)
    edges, corner_edges = np.unique(low * count + high, return_inverse=True)
    return MeshArrays(
        positions=_flat(geometry.vertices),
        corners=corners,
        corner_edges=corner_edges.astype(np.int32),
        starts=starts,
        edges=np.stack([edges // count, edges % count], -1).astype(np.int32).ravel(),
        uv=_flat(geometry.uv[corners]),
        confidence=_flat(geometry.confidence),
        normals=None if geometry.normals is None else _flat(geometry.normals),
    )


def fill_mesh(mesh: bpy.types.Mesh, arrays: MeshArrays) -> None:
    """Replace the geometry, UV, normals and attributes of a mesh; its materials stay.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh.
    arrays : MeshArrays
        The new geometry.
    """
    mesh.clear_geometry()
    mesh.vertices.add(len(arrays.positions) // 3)
    mesh.edges.add(len(arrays.edges) // 2)
    mesh.loops.add(len(arrays.corners))
    mesh.polygons.add(len(arrays.starts))
    mesh.polygons.foreach_set("loop_start", arrays.starts)
    # By their attributes these are copied whole, otherwise one by one.
    mesh.attributes["position"].data.foreach_set("vector", arrays.positions)
    for name, values in (
        (".edge_verts", arrays.edges),
        (".corner_vert", arrays.corners),
        (".corner_edge", arrays.corner_edges),
    ):
        mesh.attributes[name].data.foreach_set("value", values)
    mesh.update()
    mesh.uv_layers.new(name=UV, do_init=False).uv.foreach_set("vector", arrays.uv)
    confidence = mesh.attributes.new(CONFIDENCE, "FLOAT", "POINT")
    confidence.data.foreach_set("value", arrays.confidence)
    if arrays.normals is not None:
        domain = "POINT" if len(arrays.normals) == len(arrays.positions) else "CORNER"
        mesh.attributes.new(NORMAL, "FLOAT_VECTOR", domain).data.foreach_set(
            "vector", arrays.normals
        )


def replace_mesh(old: bpy.types.Mesh, new: bpy.types.Mesh) -> None:
    """Replace a mesh in all of its objects by another one, and remove it.

    Parameters
    ----------
    old : bpy.types.Mesh
        The mesh so far.
    new : bpy.types.Mesh
        The new mesh; gets its name.
    """
    name, new.use_fake_user = old.name, old.use_fake_user
    old.user_remap(new)
    bpy.data.meshes.remove(old)
    new.name = name


def _flat(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, np.float32).ravel()
