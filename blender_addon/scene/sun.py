"""The dominant light direction as a sun: the one distant light that best explains the shading.

Equation: shading = E / pi * max(0, n . l) + A, with the irradiance E of the sun perpendicular to
its direction l, which is Blender's strength of a sun, and the uniform light A of the world.

After `isc refine`, the lamps of the lobe are suns, too, in addition to the environment map. The map
already contains their diffuse light, so they contribute specular light alone. Rotating one moves
its highlight.
"""

import bpy
import numpy as np
from mathutils import Vector

from isc_core.errors import InputError

from ..datablocks.mesh import to_blender
from ..datablocks.provenance import KEY, datablock_name, find_tagged, tag
from .collection import link_object
from .world import set_sun_mix

_LAMPS = ("lamp1", "lamp2", "lamp3")


def ensure_sun(
    key: str, collection: bpy.types.Collection, direction: np.ndarray, strength: np.ndarray
) -> bpy.types.Object:
    """Create or update the sun.

    Parameters
    ----------
    key : str
        Name of the photo.
    collection : bpy.types.Collection
        Collection of the sun.
    direction : (3,) ndarray
        Vector toward the sun in the camera frame.
    strength : (3,) ndarray
        Irradiance, linear Rec.709.

    Returns
    -------
    bpy.types.Object
        The sun.
    """
    return _ensure_sun(key, "sun", collection, direction, strength)


def _ensure_sun(
    key: str,
    role: str,
    collection: bpy.types.Collection,
    direction: np.ndarray,
    strength: np.ndarray,
) -> bpy.types.Object:
    sun = find_tagged(bpy.data.objects, key, role)
    if sun is None:
        name = datablock_name(key, role)
        data = tag(bpy.data.lights.new(name, "SUN"), key, role)
        sun = tag(bpy.data.objects.new(name, data), key, role)
    link_object(sun, collection)
    brightest = float(max(strength.max(), 1e-9))
    sun.data.energy, sun.data.color = brightest, tuple(float(part) / brightest for part in strength)
    sun.rotation_mode = "QUATERNION"
    sun.rotation_quaternion = Vector(to_blender(direction.astype(float))).to_track_quat("Z", "Y")
    return sun


def ensure_lamps(
    key: str, collection: bpy.types.Collection, directions: np.ndarray, strengths: np.ndarray
) -> list[bpy.types.Object]:
    """Create or update the lamps of the highlights, and remove surplus ones.

    Parameters
    ----------
    key : str
        Name of the photo.
    collection : bpy.types.Collection
        Collection of the lamps.
    directions : (K, 3) ndarray
        Vectors toward the lamps in the camera frame; K may be 0.
    strengths : (K, 3) ndarray
        Irradiances, linear Rec.709.

    Returns
    -------
    list of bpy.types.Object
        The lamps.
    """
    lamps = [
        _ensure_sun(key, f"lamp{k + 1}", collection, direction, strength)
        for k, (direction, strength) in enumerate(zip(directions, strengths, strict=True))
    ]
    for lamp in lamps:
        lamp.visible_diffuse = False  # Cycles
        lamp.data.diffuse_factor = 0.0  # EEVEE
        lamp.data.angle = 0.0
    for role in _LAMPS[len(lamps) :]:
        _remove(key, role)
    return lamps


def relight(obj: bpy.types.Object, sun: bool = True) -> bpy.types.Object | None:
    """Light an object by a sun and uniform light, or by its recovered environment map.

    The light is stored in the object's properties, so this works in any file.

    Parameters
    ----------
    obj : bpy.types.Object
        An object made by ISC.
    sun : bool, optional
        Whether to use the sun.

    Returns
    -------
    bpy.types.Object or None
        The sun, if used.

    Raises
    ------
    InputError
        If the object stores no light.
    """
    key = obj.get(KEY)
    values = [obj.get(f"isc_sun_{name}") for name in ("direction", "strength", "ambient")]
    if not isinstance(key, str) or any(value is None for value in values):
        raise InputError(
            f"{obj.name} is not an object of ISC, or its light was deleted: import the result again"
        )
    direction, strength, ambient = (np.array(value, float) for value in values)
    set_sun_mix(find_tagged(bpy.data.worlds, key, "world"), ambient, sun)
    hide_lamps(key, sun)
    if not sun:
        remove_sun(key)
        return None
    collection = find_tagged(bpy.data.collections, key, "collection") or next(
        iter(obj.users_collection), bpy.context.scene.collection
    )
    return ensure_sun(key, collection, direction, strength)


def hide_lamps(key: str, hidden: bool) -> None:
    """Hide or show the lamps that light highlights alone; the sun lights highlights itself.

    Parameters
    ----------
    key : str
        The photo's.
    hidden : bool
    """
    for role in _LAMPS:
        lamp = find_tagged(bpy.data.objects, key, role)
        if lamp is not None:
            lamp.hide_render = lamp.hide_viewport = hidden


def remove_sun(key: str) -> None:
    """Remove the sun of a photo, if there is one.

    Parameters
    ----------
    key : str
        Name of the photo.
    """
    _remove(key, "sun")


def _remove(key: str, role: str) -> None:
    sun = find_tagged(bpy.data.objects, key, role)
    if sun is not None:
        data = sun.data
        bpy.data.objects.remove(sun)
        if data.users == 0:
            bpy.data.lights.remove(data)
