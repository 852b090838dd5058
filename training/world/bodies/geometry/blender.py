"""Surfaces from and to Blender's objects.

Blender's z axis is up, ours is y: (x, y, z) here is (x, -z, y) there.

Limits: one scene at a time, emptied before each body.
"""

from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.extras import install_command

from .surface import Surface


def emptied() -> Any:
    """Empty Blender's scene.

    Returns
    -------
    module
        `bpy`.

    Raises
    ------
    InputError
        If `bpy` is not installed.
    """
    try:
        import bpy
    except ImportError as error:
        raise InputError(
            f"bpy, which builds bodies of this kind, is missing: {install_command('blender')}"
        ) from error
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy


def surface_of(obj: Any) -> Surface:
    """Return the triangles of an object, with its modifiers applied.

    Parameters
    ----------
    obj : bpy.types.Object
        Of the current scene: mesh, curve, text or metaballs.

    Returns
    -------
    Surface
        y up.
    """
    import bpy

    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    faces = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.vertices.foreach_get("co", vertices)
    mesh.loop_triangles.foreach_get("vertices", faces)
    evaluated.to_mesh_clear()
    x, y, z = vertices.reshape(-1, 3).astype(float).T
    return Surface(np.stack([x, z, -y], -1), faces.reshape(-1, 3).astype(int))


def linked(bpy: Any, data: Any) -> Any:
    """Make an object of some data in the current scene.

    Parameters
    ----------
    bpy : module
        As from `emptied`.
    data : bpy.types.ID
        A mesh, a curve, a text or metaballs.

    Returns
    -------
    bpy.types.Object
        The object.
    """
    obj = bpy.data.objects.new("body", data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def mesh_object(bpy: Any, surface: Surface) -> Any:
    """Make an object of a surface in the current scene.

    Parameters
    ----------
    bpy : module
        As from `emptied`.
    surface : Surface
        y up.

    Returns
    -------
    bpy.types.Object
        A mesh object.
    """
    mesh = bpy.data.meshes.new("body")
    x, y, z = surface.vertices.T
    mesh.from_pydata(np.stack([x, -z, y], -1).tolist(), [], surface.faces.tolist())
    return linked(bpy, mesh)
