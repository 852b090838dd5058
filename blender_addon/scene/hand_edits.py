"""Whether the mesh of an object is still the one that was built: a hash of its places and faces,
stored in the mesh.

Limits: UV, attributes and modifiers do not count; they are kept, or made again, when the object is
updated.
"""

import hashlib

import bpy
import numpy as np

_BUILT = "isc_built_sha256"


def remember_mesh(mesh: bpy.types.Mesh) -> None:
    """Store the hash of a mesh as it was built.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh.
    """
    mesh[_BUILT] = _mesh_hash(mesh)


def is_edited_by_hand(obj: bpy.types.Object) -> bool:
    """Return whether the mesh of an object differs from the one that was built.

    Parameters
    ----------
    obj : bpy.types.Object
        An object that ISC made.

    Returns
    -------
    bool
        True with shape keys, too. False for an object of an earlier version, which stores no hash.
    """
    mesh = obj.data
    if mesh.shape_keys is not None:
        return True
    return _BUILT in mesh and mesh[_BUILT] != _mesh_hash(mesh)


def _mesh_hash(mesh: bpy.types.Mesh) -> str:
    places = np.empty(3 * len(mesh.vertices), np.float32)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.vertices.foreach_get("co", places)
    mesh.loops.foreach_get("vertex_index", corners)
    digest = hashlib.sha256(places.tobytes())
    digest.update(corners.tobytes())
    return digest.hexdigest()
