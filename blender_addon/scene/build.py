"""Build a result as an object in a scene: mesh, material, light, camera and photo. Building again
updates the same datablocks.
"""

import json
from dataclasses import asdict, dataclass, replace

import bpy
import numpy as np

from isc_core.errors import InputError
from isc_core.result_files.solids.body import Back

from ..datablocks.images import (
    COLOR,
    DATA,
    SRGB,
    attach_maps,
    ensure_image,
    ensure_maps,
    ensure_png_texture,
    ensure_texture,
    require_color_spaces,
    scaled_png,
)
from ..datablocks.mesh import MeshGeometry, fill_mesh, front_geometry
from ..datablocks.provenance import (
    KEY,
    PHOTO_HASH,
    ROLE,
    SOURCE_IMAGE,
    datablock_name,
    find_tagged,
    is_isc_datablock,
    photo_hash,
    require_local,
    tag,
    write_provenance,
)
from ..files.result_arrays import ResultArrays
from .body import body_geometry, prepare_body
from .camera import ensure_camera, eye_of, set_render_size
from .camera_background import set_background_photo
from .collection import (
    ensure_collection,
    ensure_optional_part,
    ensure_scene,
    link_object,
    use_standard_view,
)
from .copies import COPY, OBJECT, find_material
from .displacement import add_displacement, flatten, remove_displacement
from .hand_edits import remember_mesh
from .material import MaterialMaps, SpecularSettings, SpecularSource, ensure_material
from .photo_highlights import forget_view
from .placement import free_place
from .specular_share import specular_share
from .sun import ensure_sun, relight
from .world import ensure_world

# `BuildOptions.own_shadows` of each item of the panel.
OWN_SHADOWS: dict[str, bool | None] = {"auto": None, "on": True, "off": False}
LIGHT_AND_CAMERA = "light and camera"  # role of the part of a collection with these
_DEFAULT_ROUGHNESS = 0.5


@dataclass(frozen=True)
class BuildOptions:
    """What is built, and which of the user's settings may change.

    The field names are part of the JSON text that files store.

    Attributes
    ----------
    size_metres : float
        Longer side of the object.
    own_scene : bool
        Whether to build in a new scene. In a shared scene, a new object stands at the 3D cursor,
        and world, active camera, resolution and view transform change only with the next four
        options.
    set_world, set_camera, set_resolution, set_view_transform : bool
        What of a shared scene may change.
    light_and_camera : bool
        Whether the photo's camera and the estimated sun come along into a shared scene, in a
        collection of their own that is unchecked at first. A new scene always has the camera.
    photo_resolution : bool
        Whether renders have the photo's resolution instead of that of the maps.
    sun : bool
        Whether to use a sun and uniform light instead of the environment map.
    displacement : bool
        Whether to displace a flat grid by a modifier instead of building the height mesh.
    back : str
        A value of `Back`; "" builds the result's own mesh, whose vertices are pixels.
    triangles : int
        The most of the visible side of a mesh with a `back`; 0 for two at each pixel.
    specular_from : str
        Source of the highlights: the fitted "lobe", the photo's specular "image" until light,
        camera or pose change, or "none".
    own_shadows : bool or None
        Whether the object casts shadows and diffuse light on itself (Cycles). The recovered shading
        already contains those of the photo, so the object looks as in the photo without them. None
        enables them for a new object in a shared scene, and keeps those of an existing object.
    all_maps : bool
        Whether the file also holds the layers and maps that neither material nor exports use.
    name : str
        Name of the object; "" for the result's own.
    """

    size_metres: float = 0.1
    own_scene: bool = True
    set_world: bool = False
    set_camera: bool = False
    set_resolution: bool = False
    set_view_transform: bool = False
    light_and_camera: bool = True
    photo_resolution: bool = False
    sun: bool = False
    displacement: bool = False
    back: str = ""
    triangles: int = 50_000
    specular_from: SpecularSource = "lobe"
    own_shadows: bool | None = None
    all_maps: bool = True
    name: str = ""


@dataclass(frozen=True)
class BuiltObject:
    """An object and what belongs to it.

    Attributes
    ----------
    collection : bpy.types.Collection
        Collection of everything built of the photo.
    object : bpy.types.Object
        The object.
    camera : bpy.types.Object or None
        The photo's camera.
    world : bpy.types.World
        The recovered light; a shared scene uses it only if requested.
    scene : bpy.types.Scene
        Scene of the object.
    material : bpy.types.Material
        Material of the object.
    """

    collection: bpy.types.Collection
    object: bpy.types.Object
    camera: bpy.types.Object | None
    world: bpy.types.World
    scene: bpy.types.Scene
    material: bpy.types.Material


def build_object(
    result: ResultArrays,
    options: BuildOptions | None = None,
    *,
    scene: bpy.types.Scene | None = None,
    photo: bpy.types.Image | None = None,
) -> BuiltObject:
    """Build a result, or update what was built of the same photo under its name.

    An object of another photo is kept; the new one is then named "name-2" and so on.

    Parameters
    ----------
    result : ResultArrays
        The result.
    options : BuildOptions, optional
        What to build.
    scene : bpy.types.Scene, optional
        Shared scene to build in; the current one if None.
    photo : bpy.types.Image, optional
        Image behind the object; the masked photo of the result if None.

    Returns
    -------
    BuiltObject
        The object.

    Raises
    ------
    InputError
        Before any change: for a size that is not positive, datablocks linked from another file, a
        mesh in an edit mode, or a colour configuration without the required colour spaces.
    """
    options = options or BuildOptions()
    key = _choose_key(options.name or result.name, result, photo)
    _require_ready(key, options, scene or bpy.context.scene)
    geometry = None
    if options.back and not options.displacement:  # a displaced grid is open
        geometry, normal_map = body_geometry(
            result, options.size_metres, options.back, options.triangles
        )
        result = replace(result, normal_map=normal_map)
    scene = ensure_scene(key) if options.own_scene else scene or bpy.context.scene
    collection = ensure_collection(key, scene)
    maps = ensure_maps(key, result, options.all_maps)
    specular = _specular_settings(result, options)
    material_maps = _material_maps(key, result, maps, specular.share)
    material = ensure_material(key, material_maps, specular)
    _remove_unused(key, material_maps)
    is_new = find_tagged(bpy.data.objects, key, OBJECT) is None
    obj = _ensure_object(key, collection, result, options, material, geometry)
    if is_new and not options.own_scene:
        obj.location = free_place(obj, scene)
    attach_maps(obj, maps)
    if photo is None:
        alpha = result.mask.astype(np.float32)
        photo = ensure_image(key, "photo", result.image, COLOR, alpha)
    environment_map = ensure_image(key, "environment_map", result.environment_map, COLOR)
    world = ensure_world(key, environment_map, result.sun_ambient, options.sun)
    # Saves and appends the light with the object, whether or not a scene uses it.
    obj["isc_world"] = world
    for block in (obj, collection):
        write_provenance(block, result, json.dumps(asdict(options)))
    relight(obj, options.sun)
    camera = _ensure_camera_and_light(key, collection, obj, result, options, scene)
    if camera is not None:
        set_background_photo(camera, photo)
    built = BuiltObject(collection, obj, camera, world, scene, material)
    _set_scene(built, options, result)
    forget_view(material)  # the layer of highlights belongs to what is seen now
    return built


def prepared(result: ResultArrays, options: BuildOptions) -> ResultArrays:
    """Make in advance what takes time and no datablock; this may run in another thread.

    Parameters
    ----------
    result : ResultArrays
        The result.
    options : BuildOptions
        What will be built.

    Returns
    -------
    ResultArrays
        With `encoded`, if it has a fine texture, and with `body`, if it will have a back.

    Raises
    ------
    InputError
        If the object is too thin for a mesh.
    """
    if result.texture is not None:
        share = _specular_settings(result, options).share
        encoded = {gain: scaled_png(result.texture, gain) for gain in {1.0, 1 / (1 - share)}}
        result = replace(result, encoded=encoded)
    if options.back and not options.displacement:
        result = replace(result, body=prepare_body(result, options.back, options.triangles))
    return result


def find_built(obj: bpy.types.Object | None) -> BuiltObject | None:
    """Find what belongs to an object, camera or sun that ISC made.

    A copy of an object is found itself, with its own material, and with what it shares with the
    original. Camera, world, scene and collection are None where they were deleted, or not appended
    with the object.

    Parameters
    ----------
    obj : bpy.types.Object or None
        Any object.

    Returns
    -------
    BuiltObject or None
        None for other objects, and where the object or its material was deleted.
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
        world=find_tagged(bpy.data.worlds, key, "world"),
        scene=find_tagged(bpy.data.scenes, key, "scene") or next(iter(built.users_scene), None),
        material=material,
    )


def _choose_key(name: str, result: ResultArrays, photo: bpy.types.Image | None) -> str:
    """The name, numbered if another photo's object has it: folders may share file names."""
    key, number = name, 1
    while (obj := find_tagged(bpy.data.objects, key, OBJECT)) is not None and not _is_of_same_photo(
        obj, result, photo
    ):
        number += 1
        key = f"{name}-{number}"
    return key


def _is_of_same_photo(
    obj: bpy.types.Object, result: ResultArrays, photo: bpy.types.Image | None
) -> bool:
    """An image of this file is the same photo even if edited; otherwise the hashes decide."""
    if photo is not None and obj.get(SOURCE_IMAGE) is not None:
        return bool(obj[SOURCE_IMAGE] == photo)
    stored, given = obj.get(PHOTO_HASH, ""), photo_hash(result)
    return not stored or not given or stored == given


def _require_ready(key: str, options: BuildOptions, scene: bpy.types.Scene) -> None:
    if not 0 < options.size_metres < 1e6:
        raise InputError(
            f"a size of {options.size_metres} metres cannot be built: choose one above 0"
        )
    if not options.own_scene and scene.library is not None:
        raise InputError(
            f"the scene {scene.name} is linked from another file and cannot be changed: "
            "enable New Scene"
        )
    if options.back not in ("", *Back):
        raise InputError(f"there is no back {options.back!r}: choose {', '.join(Back)}")
    if options.triangles < 0:
        raise InputError("the number of triangles cannot be negative: 0 keeps every pixel")
    require_color_spaces(COLOR, DATA, SRGB)
    require_local(key)
    obj = find_tagged(bpy.data.objects, key, OBJECT)
    if obj is not None and obj.mode != "OBJECT":
        raise InputError(f"{obj.name} is being edited: return to Object Mode first")


def _ensure_object(
    key: str,
    collection: bpy.types.Collection,
    result: ResultArrays,
    options: BuildOptions,
    material: bpy.types.Material,
    geometry: MeshGeometry | None,
) -> bpy.types.Object:
    obj, shadows = find_tagged(bpy.data.objects, key, OBJECT), options.own_shadows
    if obj is None:
        mesh = tag(bpy.data.meshes.new(datablock_name(key)), key, "mesh")
        obj = tag(bpy.data.objects.new(datablock_name(key), mesh), key, OBJECT)
        shadows = not options.own_scene if shadows is None else shadows
    if shadows is not None:
        obj.visible_shadow = obj.visible_diffuse = shadows
    link_object(obj, collection)
    obj.shape_key_clear()
    if options.displacement:
        sheet = front_geometry(result, options.size_metres)
        fill_mesh(obj.data, flatten(sheet, eye_of(result, options.size_metres)))
        add_displacement(key, obj, result, options.size_metres)
    else:
        fill_mesh(obj.data, geometry or front_geometry(result, options.size_metres))
        remove_displacement(key, obj)
    remember_mesh(obj.data)
    if not obj.data.materials:
        obj.data.materials.append(material)
    return obj


def _ensure_camera_and_light(
    key: str,
    collection: bpy.types.Collection,
    obj: bpy.types.Object,
    result: ResultArrays,
    options: BuildOptions,
    scene: bpy.types.Scene,
) -> bpy.types.Object | None:
    """The photo's camera; in a shared scene in a part of its own, with a sun, if wanted at all."""
    if not options.own_scene and not (options.light_and_camera or options.set_camera):
        return find_tagged(bpy.data.objects, key, "camera")
    if not options.own_scene:
        shown = options.set_camera or options.sun
        collection = ensure_optional_part(key, collection, scene, LIGHT_AND_CAMERA, shown)
        if options.light_and_camera and not options.sun:
            ensure_sun(key, collection, result.sun_direction, result.sun_strength)
    return ensure_camera(
        key, collection, result, options.size_metres, obj.matrix_basis, options.photo_resolution
    )


def _material_maps(
    key: str, result: ResultArrays, maps: dict[str, bpy.types.Image], share: float
) -> MaterialMaps:
    variation, normal = None, None
    if result.specular_variation is not None:
        values = result.specular_variation / _peak(result)
        variation = ensure_texture(key, "specular_variation", values, DATA)
    # A mesh with a vertex per pixel has all detail in its own normals.
    if np.abs(result.normal_map - (0.5, 0.5, 1)).max() >= 1e-3:
        normal = ensure_texture(key, "normal_map", result.normal_map, DATA)
    if result.texture is not None:
        gain = 1 / (1 - share)
        png = result.encoded.get(gain) or scaled_png(result.texture, gain)
        base_color = ensure_png_texture(key, "base_color", png)
    else:
        base_color = ensure_texture(key, "base_color", result.base_color / (1 - share), SRGB)
    plain = result.encoded.get(1.0)
    return MaterialMaps(base_color, maps["specular"], variation, normal, plain)


def _peak(result: ResultArrays) -> float:
    """The largest factor of the specular level: textures hold values up to 1."""
    variation = result.specular_variation
    return 1.0 if variation is None else max(1.0, float(variation.max()))


def _remove_unused(key: str, maps: MaterialMaps) -> None:
    """Remove the normal map of an earlier mesh that had fewer triangles than this one."""
    old = find_tagged(bpy.data.images, key, "normal_map")
    if maps.normal is None and old is not None and old.users == 0:
        bpy.data.images.remove(old)


def _specular_settings(result: ResultArrays, options: BuildOptions) -> SpecularSettings:
    """Values of the fit; without a fitted level the object is diffuse, as in the photo's light."""
    level = result.specular_level if np.isfinite(result.specular_level) else 0.0
    roughness = result.roughness if np.isfinite(result.roughness) else _DEFAULT_ROUGHNESS
    mean = level if options.specular_from != "none" else 0.0
    if result.specular_variation is not None:
        mean *= float(result.specular_variation[result.mask].mean())
    share = specular_share(mean, roughness, result.normal[result.mask][:, 2])
    return SpecularSettings(level * _peak(result), roughness, options.specular_from, share)


def _set_scene(built: BuiltObject, options: BuildOptions, result: ResultArrays) -> None:
    if options.own_scene:
        options = replace(
            options, set_world=True, set_camera=True, set_resolution=True, set_view_transform=True
        )
    if options.set_world:
        built.scene.world = built.world
    if options.set_camera:
        built.scene.camera = built.camera
    if options.set_resolution:
        width, height = map(int, result.photo_size)
        set_render_size(built.scene, (width, height) if options.photo_resolution else result.size)
    if options.set_view_transform:
        use_standard_view(built.scene)
