"""One result becomes an object in a scene: mesh, material, light, camera, photo; built again, the
same things are updated.
"""

import json
from dataclasses import asdict, dataclass, replace
from typing import Literal

import bpy
import numpy as np

from isc_core.errors import InputError

from ..files.result_arrays import Result
from .camera import ensure_camera, frame_as_photo
from .camera_background import show_photo
from .closed_back import close_back
from .collection import ensure_collection, ensure_scene, put, show_as_photographed
from .copies import COPY, OBJECT, material_of
from .displacement import displace, flattened, undo_displacement
from .images import COLOR, DATA, attach_maps, ensure_image, ensure_maps, require_spaces
from .material import Gloss, Maps, ensure_material
from .mesh import fill_mesh, sheet
from .provenance import (
    PHOTO_HASH,
    ROLE,
    SOURCE_IMAGE,
    is_isc,
    label,
    mark,
    photo_hash,
    record,
    require_local,
)
from .provenance import find as find_block
from .sun import relight
from .world import ensure_world

__all__ = ["SHADOWS", "BuildOptions", "Built", "build", "find", "is_isc"]

SHADOWS: dict[str, bool | None] = {
    "usual": None,
    "on": True,
    "off": False,
}  # what the user's choice means for `own_shadows`
_USUAL_ROUGHNESS = 0.5
_BACK = 0.02  # of the size: how far the back lies behind the furthest point of the front


@dataclass(frozen=True)
class BuildOptions:
    """What is built, and what of the user's may be changed.

    `size_metres`: longer side of the object. `own_scene`: in a scene of its own; else in the
    current one, where the world, the active camera, the resolution and the view transform change
    only with `set_world, set_camera, set_resolution, set_view_transform`. `sun`: a sun lamp and
    even light instead of the environment. `displacement`: a flat grid that a modifier displaces,
    instead of the height mesh. `closed_back`: a wall and a flat back, so that the mesh is closed.
    `specular_from`: the gloss is the fitted "lobe", the photo's specular "image", or "none".
    `own_shadows`: whether the object casts shadows and lights itself (Cycles). The recovered
    shading holds those of the photo already, so that without them it looks as photographed. None: a
    new object does, unless it has a scene of its own; an old one as it is. `name`: the result's own
    if empty.
    """

    size_metres: float = 0.1
    own_scene: bool = True
    set_world: bool = False
    set_camera: bool = False
    set_resolution: bool = False
    set_view_transform: bool = False
    sun: bool = False
    displacement: bool = False
    closed_back: bool = False
    specular_from: Literal["lobe", "image", "none"] = "lobe"
    own_shadows: bool | None = None
    name: str = ""


@dataclass(frozen=True)
class Built:
    """What stands in the file now. `world` is the scene's only where that was wanted."""

    collection: bpy.types.Collection
    object: bpy.types.Object
    camera: bpy.types.Object
    world: bpy.types.World
    scene: bpy.types.Scene
    material: bpy.types.Material


def build(
    result: Result,
    options: BuildOptions | None = None,
    *,
    scene: bpy.types.Scene | None = None,
    photo: bpy.types.Image | None = None,
) -> Built:
    """Builds the result, or updates what was built of the same photo under its name before; another
    photo's object is left alone, the new one is then called "name-2" and so on.

    `scene`: where to, without a scene of its own; the current one if None. `photo`: shown behind
    the object; the masked one if None. Raises `InputError`, before anything is changed, for a size
    that is none, things linked from another file, a mesh being edited, a colour configuration
    without the spaces that maps need.
    """
    options = options or BuildOptions()
    key = _key(options.name or result.name, result, photo)
    _require_ready(key, options, scene or bpy.context.scene)
    scene = ensure_scene(key) if options.own_scene else scene or bpy.context.scene
    collection = ensure_collection(key, scene)
    maps = ensure_maps(key, result)
    material = ensure_material(key, _material_maps(key, result, maps), _gloss(result, options))
    thing = _object(key, collection, result, options, material)
    attach_maps(thing, maps)
    camera = ensure_camera(key, collection, result, options.size_metres, thing.matrix_basis)
    show_photo(
        camera,
        photo or ensure_image(key, "photo", result.image, COLOR, result.mask.astype(np.float32)),
    )
    world = ensure_world(
        key, ensure_image(key, "sky", result.sky, COLOR), result.sun_ambient, options.sun
    )
    thing["isc_world"] = (
        # so that the light is saved and appended with what it lights, whether or not a scene uses
        # it
        world
    )
    for block in (thing, collection):
        record(block, result, json.dumps(asdict(options)))
    relight(thing, options.sun)
    built = Built(collection, thing, camera, world, scene, material)
    _set_scene(built, options, result)
    return built


def find(thing: bpy.types.Object | None) -> Built | None:
    """What belongs to an object, camera or sun that ISC made; None for others, and where object or
    material are gone.

    A copy of an object is itself what is found, with the material that it wears, beside what it
    shares with the original. Camera, world, scene and collection are None where they were deleted,
    or not appended with the object.
    """
    if thing is None or not is_isc(thing):
        return None
    key = thing["isc_key"]
    own = thing.get(ROLE) in (OBJECT, COPY) and thing.library is None
    made = thing if own else find_block(bpy.data.objects, key, OBJECT)
    material = None if made is None else material_of(made)
    if made is None or material is None:
        return None
    collection = find_block(bpy.data.collections, key, "collection") or next(
        iter(made.users_collection), None
    )
    scene = find_block(bpy.data.scenes, key, "scene") or next(iter(made.users_scene), None)
    camera, world = (
        find_block(bpy.data.objects, key, "camera"),
        find_block(bpy.data.worlds, key, "world"),
    )
    return Built(collection, made, camera, world, scene, material)


def _key(name: str, result: Result, photo: bpy.types.Image | None) -> str:
    """The name, with a number behind it where it is that of another photo's object: photos of
    different folders may be called alike.
    """
    key, number = name, 1
    while (thing := find_block(bpy.data.objects, key, "object")) is not None and not _of_same_photo(
        thing, result, photo
    ):
        number += 1
        key = f"{name}-{number}"
    return key


def _of_same_photo(thing: bpy.types.Object, result: Result, photo: bpy.types.Image | None) -> bool:
    """An image of this file is the same photo however it was changed since; else the photos' bytes
    tell, where they are known.
    """
    if photo is not None and thing.get(SOURCE_IMAGE) is not None:
        return bool(thing[SOURCE_IMAGE] == photo)
    made_of, given = thing.get(PHOTO_HASH, ""), photo_hash(result)
    return not made_of or not given or made_of == given


def _require_ready(key: str, options: BuildOptions, scene: bpy.types.Scene) -> None:
    if not 0 < options.size_metres < 1e6:
        raise InputError(
            f"a size of {options.size_metres} metres cannot be built: give one above 0"
        )
    if not options.own_scene and scene.library is not None:
        raise InputError(
            f"the scene {scene.name} is linked from another file and cannot be changed: build in a scene of its own"
        )
    if options.displacement and options.closed_back:
        raise InputError("a displaced grid has no back: choose displacement or a closed back")
    require_spaces(COLOR, DATA)
    require_local(key)
    thing = find_block(bpy.data.objects, key, "object")
    if thing is not None and thing.mode != "OBJECT":
        raise InputError(f"{thing.name} is being edited: go back to Object Mode first")


def _object(
    key: str,
    collection: bpy.types.Collection,
    result: Result,
    options: BuildOptions,
    material: bpy.types.Material,
) -> bpy.types.Object:
    thing, shadows = find_block(bpy.data.objects, key, "object"), options.own_shadows
    if thing is None:
        thing = mark(
            bpy.data.objects.new(label(key), mark(bpy.data.meshes.new(label(key)), key, "mesh")),
            key,
            "object",
        )
        shadows = not options.own_scene if shadows is None else shadows
    if shadows is not None:
        thing.visible_shadow = thing.visible_diffuse = shadows
    put(thing, collection)
    thing.shape_key_clear()
    geometry = sheet(result, options.size_metres)
    if options.displacement:
        fill_mesh(thing.data, flattened(geometry))
        displace(key, thing, result, options.size_metres)
    else:
        fill_mesh(
            thing.data,
            close_back(geometry, _BACK * options.size_metres) if options.closed_back else geometry,
        )
        undo_displacement(key, thing)
    if not thing.data.materials:
        thing.data.materials.append(material)
    return thing


def _material_maps(key: str, result: Result, maps: dict[str, bpy.types.Image]) -> Maps:
    base = ensure_image(key, "base_color", result.base_color, COLOR)
    varies = result.specular_variation
    variation = None if varies is None else ensure_image(key, "specular_variation", varies, DATA)
    flat = (
        np.abs(result.normal_map - (0.5, 0.5, 1)).max() < 1e-3
    )  # a mesh of every pixel has all detail in its own normals
    return Maps(
        base,
        maps["specular"],
        variation,
        None if flat else ensure_image(key, "normal_map", result.normal_map, DATA),
    )


def _gloss(result: Result, options: BuildOptions) -> Gloss:
    """What the fit says; without a fitted level there is no gloss, which the photo would not show."""
    level = result.specular_level if np.isfinite(result.specular_level) else 0.0
    roughness = result.roughness if np.isfinite(result.roughness) else _USUAL_ROUGHNESS
    return Gloss(level, roughness, options.specular_from)


def _set_scene(built: Built, options: BuildOptions, result: Result) -> None:
    everything = replace(
        options, set_world=True, set_camera=True, set_resolution=True, set_view_transform=True
    )
    wanted = everything if options.own_scene else options
    if wanted.set_world:
        built.scene.world = built.world
    if wanted.set_camera:
        built.scene.camera = built.camera
    if wanted.set_resolution:
        frame_as_photo(built.scene, result.size)
    if wanted.set_view_transform:
        show_as_photographed(built.scene)
