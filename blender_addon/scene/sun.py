"""The optimal light direction as a sun lamp: the one far light that best explains the shading.

Equation: shading = E / pi * max(0, n . l) + A, with the irradiance E of the lamp across its beam, which is Blender's strength of a sun,
and the even rest A, which is the world's.
"""

import bpy
import numpy as np
from mathutils import Vector

from .collection import put
from .mesh import to_blender
from .provenance import find, label, mark


def ensure_sun(key: str, collection: bpy.types.Collection, direction: np.ndarray, strength: np.ndarray) -> bpy.types.Object:
    """The lamp: `direction` (3,) toward it in the camera's frame, `strength` (3,) its irradiance."""
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


def remove_sun(key: str) -> None:
    """Takes the lamp away, if there is one."""
    sun = find(bpy.data.objects, key, "sun")
    if sun is not None:
        data = sun.data
        bpy.data.objects.remove(sun)
        if data.users == 0:
            bpy.data.lights.remove(data)
