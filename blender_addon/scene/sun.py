"""The dominant light direction as a sun: the one distant light that best explains the shading.

Equation: shading = E / pi * max(0, n . l) + A, with the irradiance E of the sun perpendicular to
its direction l, which is Blender's strength of a sun, and the uniform light A of the world.

After `isc refine`, the lamps of the lobe are suns, too, in addition to the environment map. The map
already contains their diffuse light, so they contribute specular light alone. Rotating one moves
its highlight.
"""

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from isc_core.errors import InputError

from ..datablocks.mesh import to_blender
from ..datablocks.provenance import KEY, datablock_name, find_tagged, tag
from .built_object import scene_of
from .collection import LIGHT_AND_CAMERA, first_local, is_included, link_object
from .world import set_sun_mix, sun_mix, world_of

_LAMPS = ("lamp1", "lamp2", "lamp3")
_FITTED = "isc_fitted_lamp"  # of a lamp: direction and irradiance of the fit
_SAME_DIRECTION = 1 - 1e-6  # cosine of .08 degrees


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

    Lamps that the user has turned, or made stronger or weaker, stay as they are.

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
        _ensure_lamp(key, f"lamp{k + 1}", collection, direction, strength)
        for k, (direction, strength) in enumerate(zip(directions, strengths, strict=True))
    ]
    for lamp in lamps:
        lamp.visible_diffuse = False  # Cycles
        lamp.data.diffuse_factor = 0.0  # EEVEE
        lamp.data.angle = 0.0
    for role in _LAMPS[len(lamps) :]:
        _remove(key, role)
    return lamps


def _ensure_lamp(
    key: str,
    role: str,
    collection: bpy.types.Collection,
    direction: np.ndarray,
    strength: np.ndarray,
) -> bpy.types.Object:
    lamp = find_tagged(bpy.data.objects, key, role)
    fitted = None if lamp is None else lamp.get(_FITTED)
    if fitted is not None and not np.allclose(
        np.concatenate(_shown(lamp)), list(fitted), rtol=1e-3, atol=1e-4
    ):
        return lamp
    lamp = _ensure_sun(key, role, collection, direction, strength)
    lamp[_FITTED] = np.concatenate(_shown(lamp)).tolist()
    return lamp


def _shown(lamp: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Direction (3,) toward a lamp or the sun, in Blender's axes, and its irradiance (3,)."""
    toward = lamp.matrix_basis.to_quaternion() @ Vector((0, 0, 1))
    return np.array(toward), lamp.data.energy * np.array(lamp.data.color)


def relight(
    obj: bpy.types.Object, sun: bool = True, scene: bpy.types.Scene | None = None
) -> bpy.types.Object | None:
    """Light an object by a sun and uniform light, or by its recovered environment map.

    The light is stored in the object's properties, so this works in any file.

    Parameters
    ----------
    obj : bpy.types.Object
        An object made by ISC.
    sun : bool, optional
        Whether to use the sun.
    scene : bpy.types.Scene, optional
        Scene with the object; as `scene_of` if None.

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
    set_sun_mix(world_of(obj), ambient, sun)
    hide_lamps(key, sun)
    scene = scene or scene_of(obj) or bpy.context.scene
    if sun:
        return ensure_sun(key, sun_collection(obj, scene), direction, strength)
    part = find_tagged(bpy.data.collections, key, LIGHT_AND_CAMERA)
    current = find_tagged(bpy.data.objects, key, "sun")
    if current is None or part not in current.users_collection or is_included(part, scene):
        _remove(key, "sun")
        return None
    # The part keeps its sun for when it is included.
    ensure_sun(key, part, direction, strength)
    for collection in current.users_collection:
        if collection != part:
            collection.objects.unlink(current)
    return None


@dataclass(frozen=True, eq=False)
class ShownLight:
    """How an object is lit before it is updated.

    Attributes
    ----------
    sun : bool
        Whether by a sun and uniform light instead of the environment map.
    ambient : (3,) ndarray or None
        The uniform light, if it or the sun is no longer the estimated one.
    """

    sun: bool
    ambient: np.ndarray | None = None


def shown_light(obj: bpy.types.Object) -> ShownLight:
    """Return how an object is lit.

    Parameters
    ----------
    obj : bpy.types.Object
        An object made by ISC.

    Returns
    -------
    ShownLight
    """
    sun = find_tagged(bpy.data.objects, obj[KEY], "sun")
    mix = sun_mix(world_of(obj))
    stored = [obj.get(f"isc_sun_{name}") for name in ("direction", "strength", "ambient")]
    if sun is None or mix is None or any(value is None for value in stored):
        return ShownLight(False)
    direction, strength, ambient = (np.array(value, float) for value in stored)
    toward, irradiance = _shown(sun)
    same = (
        toward @ to_blender(direction) > _SAME_DIRECTION * np.linalg.norm(direction)
        and np.allclose(irradiance, strength, rtol=1e-3, atol=1e-6)
        and (not mix.sun or np.allclose(mix.ambient, ambient, rtol=1e-3, atol=1e-6))
    )
    return ShownLight(mix.sun, None if same else mix.ambient)


def restore_light(obj: bpy.types.Object, light: ShownLight, scene: bpy.types.Scene) -> None:
    """Light an updated object as before: by the new estimate, or by the sun as the user left it.

    Parameters
    ----------
    obj : bpy.types.Object
        An object made by ISC.
    light : ShownLight
        Of the time before the update.
    scene : bpy.types.Scene
        Scene with the object.

    Raises
    ------
    InputError
        If the object stores no light.
    """
    if light.ambient is None:
        relight(obj, light.sun, scene)
        return
    set_sun_mix(world_of(obj), light.ambient, light.sun)
    hide_lamps(obj[KEY], light.sun)


def sun_collection(obj: bpy.types.Object, scene: bpy.types.Scene) -> bpy.types.Collection:
    """Return the collection for the sun that lights an object in a scene.

    Parameters
    ----------
    obj : bpy.types.Object
        An object made by ISC.
    scene : bpy.types.Scene
        The scene.

    Returns
    -------
    bpy.types.Collection
        That of an existing sun, of the photo or of the object, if it is in the scene and can be
        changed; otherwise the scene's own. Never the part with light and camera, which view layers
        may exclude.
    """
    key, sun = obj[KEY], find_tagged(bpy.data.objects, obj[KEY], "sun")
    part = find_tagged(bpy.data.collections, key, LIGHT_AND_CAMERA)
    present = [one for one in (sun.users_collection if sun else ()) if one != part]
    of_photo = find_tagged(bpy.data.collections, key, "collection")
    return first_local([*present, of_photo, *obj.users_collection], scene)


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


def _remove(key: str, role: str) -> None:
    sun = find_tagged(bpy.data.objects, key, role)
    if sun is not None:
        data = sun.data
        bpy.data.objects.remove(sun)
        if data.users == 0:
            bpy.data.lights.remove(data)
