"""Whether the mesh of an object is still the one that was built: checksums (CRC-32) of its vertices
and faces and of its UV map, stored in the mesh, and nothing added that an update would discard.

Limits: one edit in four thousand million goes unnoticed, and changes of the attribute `confidence`,
of normals, and of what Blender stores under hidden names, such as seams.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ..datablocks.mesh import CONFIDENCE, NORMAL, UV, MeshArrays
from ..files.checksums import crc32_of
from .shading_choice import SHARP_EDGE, SHARP_FACE, shading_choice

_BUILT = "isc_built_crc32"
_OWN_ATTRIBUTES = {"position", UV, NORMAL, CONFIDENCE}
_SHADING = {SHARP_FACE, SHARP_EDGE}


def store_checksum(mesh: bpy.types.Mesh, checksum: str) -> None:
    """Store the checksum of a mesh as it was built.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh.
    checksum : str
        As `mesh_checksum` its arrays.
    """
    mesh[_BUILT] = checksum


@contextmanager
def refresh_checksum(mesh: bpy.types.Mesh) -> Iterator[None]:
    """Change the UV map of a mesh without its being taken for an edit.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh. Edits that the user made before stay edits.

    Yields
    ------
    None
    """
    former = f" {_uv_checksum(mesh)}"
    yield
    if str(mesh.get(_BUILT, "")).endswith(former):
        mesh[_BUILT] = mesh[_BUILT].removesuffix(former) + f" {_uv_checksum(mesh)}"


def mesh_checksum(arrays: MeshArrays) -> str:
    """Return the checksum of a mesh that will be built; this may run in another thread.

    Parameters
    ----------
    arrays : MeshArrays
        The mesh.

    Returns
    -------
    str
        Eight hexadecimal digits for vertices and faces, and eight for the UV map.
    """
    return f"{_of_arrays(arrays.positions, arrays.corners)} {_of_arrays(arrays.uv)}"


def is_edited_by_hand(obj: bpy.types.Object) -> bool:
    """Return whether the mesh of an object differs from the one that was built.

    Parameters
    ----------
    obj : bpy.types.Object
        An object that ISC made.

    Returns
    -------
    bool
        True with shape keys, vertex groups, levels of a Multiresolution modifier, further UV maps
        or attributes, faces of other materials, or single flat faces and sharp edges, too. Shade
        Smooth and Shade Flat, which an update repeats, are no edits. What an earlier version did
        not store is taken for unchanged.
    """
    mesh = obj.data
    # The mesh holds what was sculpted on them.
    levels = [mod.total_levels for mod in obj.modifiers if mod.type == "MULTIRES"]
    if mesh.shape_keys is not None or len(obj.vertex_groups) > 0 or any(levels):
        return True
    if _has_other_attributes(mesh):
        return True
    if _BUILT not in mesh:
        return False
    places = np.empty(3 * len(mesh.vertices), np.float32)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.vertices.foreach_get("co", places)
    mesh.loops.foreach_get("vertex_index", corners)
    shape, *texture = mesh[_BUILT].split()
    return bool(shape != _of_arrays(places, corners) or texture not in ([], [_uv_checksum(mesh)]))


def _has_other_attributes(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh has attributes that were not built; Blender hides its own behind a dot."""
    names = {attribute.name for attribute in mesh.attributes if not attribute.name.startswith(".")}
    indices = mesh.attributes.get("material_index")
    if indices is not None:
        values = np.empty(len(indices.data), np.int32)
        indices.data.foreach_get("value", values)
        if values.any():
            return True
    if names & _SHADING and shading_choice(mesh) is None:
        return True
    return bool(names - _OWN_ATTRIBUTES - _SHADING - {"material_index"})


def _uv_checksum(mesh: bpy.types.Mesh) -> str:
    layer = mesh.uv_layers.get(UV)
    if layer is None:
        return ""
    places = np.empty(2 * len(mesh.loops), np.float32)
    layer.uv.foreach_get("vector", places)
    return _of_arrays(places)


def _of_arrays(*parts: np.ndarray) -> str:
    return crc32_of(*(part.tobytes() for part in parts))
