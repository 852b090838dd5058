"""The collection with everything that ISC builds of one photo, and the scene that shows it."""

from collections.abc import Iterable
from contextlib import suppress

import bpy

from ..datablocks.provenance import datablock_name, find_tagged, tag

LIGHT_AND_CAMERA = "light and camera"  # role of the part of a collection with these

_PREVIEW_SAMPLES = 32


def ensure_collection(
    key: str, scene: bpy.types.Scene, obj: bpy.types.Object | None
) -> bpy.types.Collection:
    """Find or create the collection of a photo, and link it to a scene that lacks the object.

    Parameters
    ----------
    key : str
        Name of the photo.
    scene : bpy.types.Scene
        The scene.
    obj : bpy.types.Object or None
        The photo's object, if it exists. Where the scene has it, users have arranged it as they
        want, and an existing collection stays where it is.

    Returns
    -------
    bpy.types.Collection
        The collection; for a new object, view layers include it.
    """
    collection = find_tagged(bpy.data.collections, key, "collection")
    if collection is None:
        collection = tag(bpy.data.collections.new(datablock_name(key)), key, "collection")
    elif obj is not None and is_in_scene(obj, scene):
        return collection
    if collection not in set(scene.collection.children_recursive):
        scene.collection.children.link(collection)
    if obj is None and not is_included(collection, scene):
        _include(collection, scene)
    return collection


def _include(collection: bpy.types.Collection, scene: bpy.types.Scene) -> None:
    """Check a collection in the view layers of a scene; what is in it stays unchecked."""
    for layer in scene.view_layers:
        entry = layer.layer_collection and find_layer_collection(layer.layer_collection, collection)
        if entry:
            entry.exclude = False
            for child in entry.children:
                child.exclude = True


def ensure_scene(
    key: str, current: bpy.types.Scene, obj: bpy.types.Object | None
) -> bpy.types.Scene:
    """Find or create a photo's own scene.

    Parameters
    ----------
    key : str
        Name of the photo.
    current : bpy.types.Scene
        The scene in use. If it is the photo's own, or a copy of it with the object, it is returned.
    obj : bpy.types.Object or None
        The photo's object, if it exists.

    Returns
    -------
    bpy.types.Scene
        The scene; a new one renders with Cycles and a transparent background, and shows colours
        unchanged.
    """
    first = [current] if obj is None or is_in_scene(obj, current) else []
    scene = find_tagged([*first, *bpy.data.scenes], key, "scene")
    if scene is None:
        scene = tag(bpy.data.scenes.new(datablock_name(key)), key, "scene")
        if hasattr(scene, "cycles"):  # an add-on, which may be disabled
            scene.render.engine, scene.cycles.samples = "CYCLES", 64
            scene.cycles.preview_samples, scene.cycles.use_preview_denoising = (
                _PREVIEW_SAMPLES,
                True,
            )
            # The photo's camera has already smoothed the texture: Blender's default pixel filter
            # would smooth it once more.
            scene.cycles.filter_width = 0.5
        scene.render.film_transparent = True
        scene.eevee.taa_samples = _PREVIEW_SAMPLES
        use_standard_view(scene)
    return scene


def ensure_optional_part(
    key: str, collection: bpy.types.Collection, scene: bpy.types.Scene, role: str, shown: bool
) -> bpy.types.Collection:
    """Find or create a part of a photo's collection that a scene may leave unused.

    Parameters
    ----------
    key : str
        Name of the photo.
    collection : bpy.types.Collection
        The photo's collection, linked to the scene.
    scene : bpy.types.Scene
        The scene.
    role : str
        Purpose of the part.
    shown : bool
        Whether the scene uses the part. Otherwise a new part is excluded from the view layers: its
        lights are neither in the viewport nor in renders. An existing part is not changed then.

    Returns
    -------
    bpy.types.Collection
        The part.
    """
    part = find_tagged(bpy.data.collections, key, role)
    is_new = part is None
    if is_new:
        part = tag(bpy.data.collections.new(datablock_name(key, role)), key, role)
        collection.children.link(part)
    if is_new or shown:
        use_part(part, scene, shown)
    return part


def use_part(part: bpy.types.Collection, scene: bpy.types.Scene, shown: bool) -> None:
    """Set whether the view layers of a scene use a collection.

    Parameters
    ----------
    part : bpy.types.Collection
        The collection.
    scene : bpy.types.Scene
        The scene.
    shown : bool
        Whether they include it.
    """
    for layer in scene.view_layers:
        if layer.layer_collection is None:  # of a scene that was never shown (Blender 5.3)
            layer.update()
        entry = find_layer_collection(layer.layer_collection, part)
        if entry is not None:
            entry.exclude = not shown


def find_layer_collection(
    entry: bpy.types.LayerCollection, collection: bpy.types.Collection
) -> bpy.types.LayerCollection | None:
    """Find the entry of a collection in a view layer, which says whether the layer uses it.

    Parameters
    ----------
    entry : bpy.types.LayerCollection
        Where to begin; the view layer's own for all of it.
    collection : bpy.types.Collection
        The collection.

    Returns
    -------
    bpy.types.LayerCollection or None
        None where the view layer does not have it.
    """
    if entry.collection == collection:
        return entry
    below = (find_layer_collection(child, collection) for child in entry.children)
    return next((found for found in below if found is not None), None)


def is_included(collection: bpy.types.Collection, scene: bpy.types.Scene) -> bool:
    """Return whether a view layer of a scene includes a collection.

    Parameters
    ----------
    collection : bpy.types.Collection
        The collection.
    scene : bpy.types.Scene
        The scene.

    Returns
    -------
    bool
    """
    roots = (layer.layer_collection for layer in scene.view_layers)
    entries = (find_layer_collection(root, collection) for root in roots if root is not None)
    return any(entry is not None and not entry.exclude for entry in entries)


def first_local(
    collections: Iterable[bpy.types.Collection | None], scene: bpy.types.Scene
) -> bpy.types.Collection:
    """Return the first collection of a scene to which objects can be linked.

    Parameters
    ----------
    collections : iterable of bpy.types.Collection or None
        Collections in the order of preference. One of another scene, of another file or with a
        library override is passed over.
    scene : bpy.types.Scene
        The scene.

    Returns
    -------
    bpy.types.Collection
        The scene's own if none is left.
    """
    in_scene = {scene.collection, *scene.collection.children_recursive}
    return next(
        (
            one
            for one in collections
            if one is not None
            and one in in_scene
            and one.library is None
            and one.override_library is None
        ),
        scene.collection,
    )


def is_in_scene(obj: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Return whether a scene has an object, in whatever collection.

    Parameters
    ----------
    obj : bpy.types.Object
        The object.
    scene : bpy.types.Scene
        The scene.

    Returns
    -------
    bool
    """
    return any(other == obj for other in scene.objects)


def link_object(obj: bpy.types.Object, collection: bpy.types.Collection) -> None:
    """Link an object to a collection, unless it is linked.

    Parameters
    ----------
    obj : bpy.types.Object
        The object.
    collection : bpy.types.Collection
        The collection.
    """
    if obj.name not in collection.objects or collection.objects[obj.name] != obj:
        collection.objects.link(obj)


def use_standard_view(scene: bpy.types.Scene) -> None:
    """Set a scene to show colours unchanged: no look, no exposure.

    A view transform of a custom colour configuration is kept.

    Parameters
    ----------
    scene : bpy.types.Scene
        The scene.
    """
    view = scene.view_settings
    view.exposure, view.gamma, view.use_curve_mapping = 0.0, 1.0, False
    with suppress(TypeError):  # a custom colour configuration may lack them
        view.view_transform, view.look = "Standard", "None"
