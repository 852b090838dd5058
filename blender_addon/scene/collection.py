"""The collection that holds all that ISC makes of one image, and the scene that it stands in."""

from contextlib import suppress

import bpy

from .provenance import find, label, mark


def ensure_collection(key: str, scene: bpy.types.Scene) -> bpy.types.Collection:
    """The collection of that image, in the scene."""
    collection = find(bpy.data.collections, key, "collection") or mark(
        bpy.data.collections.new(label(key)), key, "collection"
    )
    if collection not in set(scene.collection.children_recursive):
        scene.collection.children.link(collection)
    return collection


def ensure_scene(key: str) -> bpy.types.Scene:
    """The image's own scene: a new one renders with Cycles, the object alone before nothing."""
    scene = find(bpy.data.scenes, key, "scene")
    if scene is None:
        scene = mark(bpy.data.scenes.new(label(key)), key, "scene")
        if hasattr(scene, "cycles"):  # an add-on, which people may have switched off
            scene.render.engine, scene.cycles.samples = "CYCLES", 64
            # the photo's camera has smoothed the texture: Blender's usual filter would once more
            scene.cycles.filter_width = 0.5
        scene.render.film_transparent = True
    return scene


def put(thing: bpy.types.Object, collection: bpy.types.Collection) -> None:
    """Puts an object into the collection, if it is not there."""
    if thing.name not in collection.objects or collection.objects[thing.name] != thing:
        collection.objects.link(thing)


def show_as_photographed(scene: bpy.types.Scene) -> None:
    """Colours on the screen and in files as they are: no film look, no exposure.

    Views that are not Blender's own stay.
    """
    view = scene.view_settings
    view.exposure, view.gamma, view.use_curve_mapping = 0.0, 1.0, False
    with suppress(TypeError):  # in somebody's colour configuration they may not exist
        view.view_transform, view.look = "Standard", "None"
