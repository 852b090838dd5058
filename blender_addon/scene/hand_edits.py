"""Whether the mesh of an object is still the one that was built: a checksum (CRC-32) of its
vertices and faces, stored in the mesh.

Limits: one edit in four thousand million goes unnoticed. UV maps, attributes and modifiers are not
included; an update of the object keeps or replaces them.
"""

import zlib

import bpy
import numpy as np

from ..datablocks.mesh import MeshArrays

_BUILT = "isc_built_crc32"


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


def mesh_checksum(arrays: MeshArrays) -> str:
    """Return the checksum of a mesh that will be built; this may run in another thread.

    Parameters
    ----------
    arrays : MeshArrays
        The mesh.

    Returns
    -------
    str
        Eight hexadecimal digits.
    """
    return _checksum(arrays.positions, arrays.corners)


def is_edited_by_hand(obj: bpy.types.Object) -> bool:
    """Return whether the mesh of an object differs from the one that was built.

    Parameters
    ----------
    obj : bpy.types.Object
        An object that ISC made.

    Returns
    -------
    bool
        True with shape keys, too. False for an object of an earlier version, which stores none.
    """
    mesh = obj.data
    if mesh.shape_keys is not None:
        return True
    if _BUILT not in mesh:
        return False
    places = np.empty(3 * len(mesh.vertices), np.float32)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.vertices.foreach_get("co", places)
    mesh.loops.foreach_get("vertex_index", corners)
    return bool(mesh[_BUILT] != _checksum(places, corners))


def _checksum(places: np.ndarray, corners: np.ndarray) -> str:
    # As text: Blender stores whole numbers with a sign.
    return f"{zlib.crc32(corners.tobytes(), zlib.crc32(places.tobytes())):08x}"
