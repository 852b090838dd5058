"""Whether the mesh of an object is still the one that was built: a checksum (CRC-32) of its places
and faces, stored in the mesh.

Limits: one edit in four thousand million goes unnoticed. UV, attributes and modifiers do not count;
they are kept, or made again, when the object is updated.
"""

import zlib

import bpy
import numpy as np

_BUILT = "isc_built_crc32"


def remember_mesh(mesh: bpy.types.Mesh) -> None:
    """Store the checksum of a mesh as it was built.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh.
    """
    mesh[_BUILT] = _checksum(mesh)


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
    return _BUILT in mesh and mesh[_BUILT] != _checksum(mesh)


def _checksum(mesh: bpy.types.Mesh) -> str:
    places = np.empty(3 * len(mesh.vertices), np.float32)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.vertices.foreach_get("co", places)
    mesh.loops.foreach_get("vertex_index", corners)
    # As text: Blender stores whole numbers with a sign.
    return f"{zlib.crc32(corners.tobytes(), zlib.crc32(places.tobytes())):08x}"
