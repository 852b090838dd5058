"""An object and what belongs to it, found again in any file by the custom properties of ISC."""

from dataclasses import dataclass

import bpy

from ..datablocks.provenance import KEY, ROLE, find_tagged, is_isc_datablock
from .collection import is_in_scene
from .copies import COPY, OBJECT, are_of_one_photo, find_material
from .world import world_of

LIGHT_OF = "isc_light_of"  # of an object: the key of the object of its photo that has the light


@dataclass(frozen=True)
class BuiltObject:
    """An object and what belongs to it.

    Attributes
    ----------
    collection : bpy.types.Collection
        Collection of everything built from the photo.
    object : bpy.types.Object
        The object.
    camera : bpy.types.Object or None
        The photo's camera.
    world : bpy.types.World
        The recovered light; a shared scene uses it only if requested.
    scene : bpy.types.Scene
        Scene of the object; the current one if it is in several.
    material : bpy.types.Material
        Material of ISC; the user may have assigned another.
    """

    collection: bpy.types.Collection
    object: bpy.types.Object
    camera: bpy.types.Object | None
    world: bpy.types.World
    scene: bpy.types.Scene
    material: bpy.types.Material


def find_built(obj: bpy.types.Object | None) -> BuiltObject | None:
    """Find what belongs to an object, camera or sun that ISC made.

    For a copy, this is the copy with its own material, and what it shares with the original.
    Camera, world, scene and collection are None if they were deleted, or not appended with the
    object.

    Parameters
    ----------
    obj : bpy.types.Object or None
        Any object.

    Returns
    -------
    BuiltObject or None
        None for other objects, or if the object or its material was deleted.
    """
    if obj is None or not is_isc_datablock(obj):
        return None
    key = obj[KEY]
    is_local_object = obj.get(ROLE) in (OBJECT, COPY) and obj.library is None
    built = obj if is_local_object else find_tagged(bpy.data.objects, key, OBJECT)
    material = None if built is None else find_material(built)
    if built is None or material is None:
        return None
    return BuiltObject(
        collection=find_tagged(bpy.data.collections, key, "collection")
        or next(iter(built.users_collection), None),
        object=built,
        camera=find_tagged(bpy.data.objects, key, "camera"),
        world=world_of(built),
        scene=scene_of(built),
        material=material,
    )


def scene_of(obj: bpy.types.Object) -> bpy.types.Scene | None:
    """Return the scene in which an object is edited.

    Parameters
    ----------
    obj : bpy.types.Object
        An object of ISC.

    Returns
    -------
    bpy.types.Scene or None
        The current scene if it has the object, else the object's own, else any that has it.
    """
    scenes = obj.users_scene
    if bpy.context.scene in scenes:
        return bpy.context.scene
    return find_tagged(bpy.data.scenes, obj[KEY], "scene") or next(iter(scenes), None)


def light_owner(built: BuiltObject) -> BuiltObject:
    """Return the object whose light shines on an object.

    Parameters
    ----------
    built : BuiltObject
        An object of ISC.

    Returns
    -------
    BuiltObject
        Of several objects of a photo the largest one, if it is in the same scene; otherwise the
        object itself.
    """
    obj = built.object
    owner = find_tagged(bpy.data.objects, obj.get(LIGHT_OF, ""), OBJECT)
    if owner is None or built.scene is None or not is_in_scene(owner, built.scene):
        return built
    if not are_of_one_photo(owner, obj):  # of a file to which this one was appended
        return built
    return find_built(owner) or built


def selection_problem(obj: bpy.types.Object | None) -> str:
    """Return why the operators of ISC cannot be used on an object.

    Parameters
    ----------
    obj : bpy.types.Object or None
        Any object.

    Returns
    -------
    str
        What to do, as a tooltip; "" if they can be used.
    """
    if find_built(obj) is not None:
        return ""
    if obj is not None and obj.library is not None and is_isc_datablock(obj):
        return (
            f"{obj.name} is linked from another file: make it local first (Object > Relations > "
            "Make Local > All)"
        )
    return "Select an object created by ISC"
