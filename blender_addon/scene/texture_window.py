"""The part of the photo that the textures of an object cover.

Problem: with another mask, the textures cover another part of the photo. The object gets a new mesh
for them; a copy with a mesh of its own (Shift D) has the same textures and its former UV map.

Equation: with the window (left, bottom, width, height) in parts of the photo, a place of the photo
is (left, bottom) + uv (width, height). The UV map of a copy changes so that its places stay.
"""

from collections.abc import Iterable

import bpy
import numpy as np

from ..datablocks.mesh import UV
from ..files.result_arrays import ResultArrays
from .hand_edits import refresh_checksum

_WINDOW = "isc_uv_window"  # of a mesh


def move_textures(obj: bpy.types.Object, copies: Iterable[bpy.types.Object]) -> None:
    """Adapt copies with meshes of their own to the textures of an updated object.

    Parameters
    ----------
    obj : bpy.types.Object
        The object, whose mesh has a window.
    copies : iterable of bpy.types.Object
        Its copies. A mesh of an earlier version, which stores no window, is left alone.
    """
    meshes = {copy.data: None for copy in copies if copy.data != obj.data}
    window = obj.data[_WINDOW]
    for mesh in meshes:
        layer, former = mesh.uv_layers.get(UV), mesh.get(_WINDOW)
        if layer is None or former is None or list(former) == list(window) or mesh.library:
            continue
        with refresh_checksum(mesh):
            places = np.empty(2 * len(mesh.loops), np.float32)
            layer.uv.foreach_get("vector", places)
            (corner, size), (new_corner, new_size) = (
                np.array(values, float).reshape(2, 2) for values in (former, window)
            )
            moved = (corner + places.reshape(-1, 2) * size - new_corner) / new_size
            # Through `layer.uv`, Blender 5 would change the copies that share the values, too.
            values = mesh.attributes[UV].data
            values.foreach_set("vector", moved.astype(np.float32).ravel())
            mesh[_WINDOW] = window


def store_window(mesh: bpy.types.Mesh, result: ResultArrays) -> None:
    """Store the window of a result in its mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh.
    result : ResultArrays
        The result.
    """
    (x, y), (height, width) = result.part.corner, result.mask.shape
    columns, rows = result.size
    mesh[_WINDOW] = [x / columns, 1 - (y + height) / rows, width / columns, height / rows]
