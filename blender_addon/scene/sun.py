"""The optimal light direction as a sun lamp: the one far light that best explains the shading.

Equation: shading = E / pi * max(0, n . l) + A, with the irradiance E of the lamp across its beam,
which is Blender's strength of a sun, and the even rest A, which is the world's.
"""

import bpy
import numpy as np
from mathutils import Vector

from isc_core.errors import InputError

from .collection import put
from .mesh import to_blender
from .provenance import KEY, find, label, mark
from .world import mix_sun


def ensure_sun(
    key: str, collection: bpy.types.Collection, direction: np.ndarray, strength: np.ndarray
) -> bpy.types.Object:
    """The lamp:

    `direction` (3,) toward it in the camera's frame, `strength` (3,) its irradiance.
    """
    sun = find(bpy.data.objects, key, "sun")
    if sun is None:
        data = mark(bpy.data.lights.new(label(key, "sun"), "SUN"), key, "sun")
        sun = mark(bpy.data.objects.new(label(key, "sun"), data), key, "sun")
    put(sun, collection)
    brightest = float(max(strength.max(), 1e-9))
    sun.data.energy, sun.data.color = brightest, tuple(float(part) / brightest for part in strength)
    sun.rotation_mode = "QUATERNION"
    sun.rotation_quaternion = Vector(to_blender(direction.astype(float))).to_track_quat("Z", "Y")
    return sun


def relight(thing: bpy.types.Object, on: bool = True) -> bpy.types.Object | None:
    """Lights an object that ISC made by its sun and even light, or by its recovered environment
    again; returns the sun.

    The directions are the object's properties, so that this works in any file. Raises `InputError`
    if it has none.
    """
    key, values = (
        thing.get(KEY),
        [thing.get(f"isc_sun_{name}") for name in ("direction", "strength", "ambient")],
    )
    if not isinstance(key, str) or any(value is None for value in values):
        raise InputError(
            f"{thing.name} is not an object of ISC, or its light was deleted: import the result again"
        )
    direction, strength, ambient = (np.array(value, float) for value in values)
    mix_sun(find(bpy.data.worlds, key, "world"), ambient, on)
    if not on:
        remove_sun(key)
        return None
    collection = find(bpy.data.collections, key, "collection") or next(
        iter(thing.users_collection), bpy.context.scene.collection
    )
    return ensure_sun(key, collection, direction, strength)


def remove_sun(key: str) -> None:
    """Takes the lamp away, if there is one."""
    sun = find(bpy.data.objects, key, "sun")
    if sun is not None:
        data = sun.data
        bpy.data.objects.remove(sun)
        if data.users == 0:
            bpy.data.lights.remove(data)
