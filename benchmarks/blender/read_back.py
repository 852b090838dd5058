"""Render an object, and again after it was exported and read back.

Problem: does another program show the same object? The file is imported by Blender's own importers
into a copy of the scene from which the original was removed, and rendered by Cycles with the same
camera and light.

Limits: both are Blender's: errors that its exporter and its importer share are not found.
"""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import bpy
import numpy as np

from blender_addon.scene.built_object import BuiltObject

from .renders import render_scene

READERS: Mapping[str, tuple[str, Callable[[str], None]]] = {
    "GLB": ("glb", lambda path: bpy.ops.import_scene.gltf(filepath=path)),
    "USD": ("usdc", lambda path: bpy.ops.wm.usd_import(filepath=path)),
    "FBX": ("fbx", lambda path: bpy.ops.import_scene.fbx(filepath=path)),
    "OBJ": ("obj", lambda path: bpy.ops.wm.obj_import(filepath=path)),
}


def shown(built: BuiltObject, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Render an object in its scene.

    Parameters
    ----------
    built : BuiltObject
        The object.
    samples : int
        Samples per pixel.

    Returns
    -------
    image : (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        Pixels that the object covers.
    """
    image, coverage = render_scene(built.scene, samples)
    return image, coverage > 0.99


def read_back(built: BuiltObject, path: Path, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Render an exported object in the place of the original; the open file is then a copy.

    Parameters
    ----------
    built : BuiltObject
        The object; no longer valid afterwards.
    path : Path
        The exported file; its suffix is one of `READERS`.
    samples : int
        Samples per pixel.

    Returns
    -------
    image, mask : ndarray
        As of `shown`.
    """
    scene, name = built.scene.name, built.object.name
    flags = built.object.visible_shadow, built.object.visible_diffuse
    with tempfile.TemporaryDirectory() as folder:
        copy = str(Path(folder) / "copy.blend")
        bpy.ops.wm.save_as_mainfile(filepath=copy, copy=True, check_existing=False)
        bpy.ops.wm.open_mainfile(filepath=copy)
    bpy.context.window.scene = bpy.data.scenes[scene]
    bpy.data.objects.remove(bpy.data.objects[name])
    before = set(bpy.data.objects)
    next(read for suffix, read in READERS.values() if path.suffix == f".{suffix}")(str(path))
    for obj in set(bpy.data.objects) - before:
        obj.visible_shadow, obj.visible_diffuse = flags
    image, coverage = render_scene(bpy.data.scenes[scene], samples)
    return image, coverage > 0.99
