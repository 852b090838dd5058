"""Build a result as an object in a scene: mesh, material, light, camera and photo. Building again
updates the same datablocks.
"""

import json
from collections.abc import Generator
from dataclasses import asdict, dataclass, replace

import bpy
import numpy as np
from mathutils import Matrix

from isc_core.errors import InputError

from ..datablocks.images import (
    COLOR,
    DATA,
    MAPS,
    SRGB,
    ImageRole,
    attach_maps,
    replace_image,
    require_color_spaces,
)
from ..datablocks.mesh import replace_mesh
from ..datablocks.provenance import (
    PHOTO_HASH,
    SOURCE_IMAGE,
    datablock_name,
    find_tagged,
    is_isc_datablock,
    photo_hash,
    require_local,
    tag,
    write_provenance,
)
from ..datablocks.staging import StagedBlocks, run_to_end, stage
from ..files.result_arrays import ResultArrays
from ..materials.coated_surface import recovered_light
from ..materials.gloss_edits import GlossBasis
from ..materials.material import (
    MaterialMaps,
    SpecularSettings,
    ensure_material,
    shows_highlights,
    update_material,
)
from ..materials.photo_highlights import reset_view
from .built_object import BuiltObject
from .camera import ensure_camera, set_background_photo, set_render_size
from .collection import (
    LIGHT_AND_CAMERA,
    ensure_collection,
    ensure_optional_part,
    ensure_scene,
    is_in_scene,
    link_object,
    use_part,
    use_standard_view,
)
from .copies import (
    MATERIAL,
    OBJECT,
    copies_of,
    find_material,
    keep_material,
    materials_of_copies,
)
from .displacement import add_displacement, remove_displacement
from .hand_edits import store_checksum
from .placement import free_location, world_matrix
from .preparation import BuildOptions, PreparedObject, prepare, require_options
from .shading_choice import shade, shading_choice, store_normals
from .sun import ShownLight, ensure_lamps, ensure_sun, restore_light, shown_light
from .texture_window import move_textures, store_window
from .world import ensure_world, keep_world, world_of

_RESOLUTION = "isc_resolution"  # of a scene: what was set last
_NO_LAMPS = np.zeros((0, 3))
# Textures that only some builds have.
_OPTIONAL_TEXTURES = (
    ImageRole.NORMAL_MAP,
    ImageRole.ALPHA,
    ImageRole.PLAIN_BASE_COLOR,
    ImageRole.VIEW_NORMAL,
)


@dataclass(frozen=True)
class StagedObject:
    """An object of which only the images and the mesh exist.

    Attributes
    ----------
    prepared : PreparedObject
        What it is built of.
    blocks : StagedBlocks
        Its images and mesh.
    """

    prepared: PreparedObject
    blocks: StagedBlocks


def build_object(
    result: ResultArrays,
    options: BuildOptions | None = None,
    *,
    scene: bpy.types.Scene | None = None,
    photo: bpy.types.Image | None = None,
) -> BuiltObject:
    """Build a result, or update what was built of the same photo under its name.

    An object of another photo is not changed; the new one is then named "name-2" and so on.

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
    require_options(options)
    _require_ready(_choose_key(result, options, photo), options, scene or bpy.context.scene)
    prepared = prepare(result, options, with_photo=photo is None)
    steps = stage_object(prepared, key_of(prepared, photo))
    return place_object(run_to_end(steps), scene=scene, photo=photo)


def stage_object(prepared: PreparedObject, key: str) -> Generator[None, None, StagedObject]:
    """Create the images and the mesh of an object in short steps; the scene is unchanged.

    Between two steps anything may happen, including an undo. If it is closed early, nothing is left
    behind.

    Parameters
    ----------
    prepared : PreparedObject
        What it is built of.
    key : str
        As `key_of` returns it.

    Returns
    -------
    StagedObject
        For `place_object`, to be called at once.
    """
    while True:
        base = _mesh_number(key)
        blocks = yield from stage(prepared.files, prepared.mesh, base)
        if blocks.exist and _mesh_number(key) == base:
            return StagedObject(prepared, blocks)
        blocks.discard()


def key_of(prepared: PreparedObject, photo: bpy.types.Image | None) -> str:
    """Return the key that a prepared object has in this file.

    Parameters
    ----------
    prepared : PreparedObject
        What it is built of.
    photo : bpy.types.Image or None
        Image behind the object.

    Returns
    -------
    str
        The name of the photo, numbered if the object of another photo has it.
    """
    return _choose_key(prepared.result, prepared.options, photo)


def place_object(
    staged: StagedObject,
    *,
    scene: bpy.types.Scene | None = None,
    photo: bpy.types.Image | None = None,
    matrix: Matrix | None = None,
    bounds: np.ndarray | None = None,
) -> BuiltObject:
    """Put a staged object in the scene, as `build_object` does, in one short call.

    Parameters
    ----------
    staged : StagedObject
        The object; its datablocks are used, or removed.
    scene, photo
        As of `build_object`.
    matrix : Matrix, optional
        Transform of a new object; None uses the 3D cursor, or the origin of its own scene.
    bounds : (2, 3) ndarray, optional
        Minimum and maximum corner of what is placed at the cursor, relative to the object's origin;
        those of its mesh if None.

    Returns
    -------
    BuiltObject
        The object.

    Raises
    ------
    InputError
        As of `build_object`.
    """
    try:
        scene = scene or bpy.context.scene
        return _place(staged.prepared, staged.blocks, scene, photo, (matrix, bounds))
    finally:
        staged.blocks.discard()


def require_placeable(
    staged: StagedObject,
    *,
    scene: bpy.types.Scene | None = None,
    photo: bpy.types.Image | None = None,
) -> None:
    """Check that a staged object can be placed.

    Parameters
    ----------
    staged : StagedObject
        The object.
    scene, photo
        As of `build_object`.

    Raises
    ------
    InputError
        As of `build_object`.
    """
    key = key_of(staged.prepared, photo)
    _require_ready(key, staged.prepared.options, scene or bpy.context.scene)


def _place(
    prepared: PreparedObject,
    blocks: StagedBlocks,
    scene: bpy.types.Scene,
    photo: bpy.types.Image | None,
    position: tuple[Matrix | None, np.ndarray | None],
) -> BuiltObject:
    result, options = prepared.result, prepared.options
    key = _choose_key(result, options, photo)
    _require_ready(key, options, scene)
    existing = find_tagged(bpy.data.objects, key, OBJECT)
    if options.own_scene:
        scene = ensure_scene(key, scene, existing)
    collection = ensure_collection(key, scene, existing)
    light, had_sun = _light_before(existing, options), _stored_option(existing, "sun", False)
    images = {
        role: replace_image(image, key, role)
        for role in prepared.files
        if (image := blocks.take_image(role)) is not None
    }
    maps = MaterialMaps(
        base_color=images[ImageRole.BASE_COLOR],
        specular=images[ImageRole.SPECULAR],
        variation=images.get(ImageRole.SPECULAR_VARIATION),
        normal=images.get(ImageRole.NORMAL_MAP),
        alpha=images.get(ImageRole.ALPHA),
        basis=_gloss_basis(result, images),
    )
    material = _ensure_materials(key, existing, maps, prepared.specular)
    _remove_unused(key, images)
    obj = _ensure_object(key, prepared, blocks.take_mesh(), material)
    copies = [] if existing is None else copies_of(obj, key)
    move_textures(obj, copies)
    if not is_in_scene(obj, scene):
        link_object(obj, collection)
    if options.displacement:
        add_displacement(key, obj, images[ImageRole.DISPLACEMENT], result.eye is not None)
    else:
        remove_displacement(key, obj)
    if existing is None:
        _position(obj, options, scene, *position)
    attach_maps(obj, {role: images[role] for role in MAPS if role in images})
    former = find_tagged(bpy.data.worlds, key, "world") if existing is None else world_of(obj)
    sky = images[ImageRole.ENVIRONMENT_MAP]
    world = ensure_world(key, sky, result.sun_ambient, options.sun, former)
    keep_world(obj, world)
    keep_material(obj, material)
    for block in (obj, collection):
        write_provenance(block, result, json.dumps(asdict(options)))
    lamps = options.own_scene and options.specular_from != "none"
    ensure_lamps(key, collection, *_lamps(result) if lamps else (_NO_LAMPS, _NO_LAMPS))
    restore_light(obj, light, scene)
    keep_sun = light.ambient is not None
    camera = _ensure_camera_and_light(key, collection, obj, result, options, scene, keep_sun)
    if had_sun and not options.sun and scene.camera != camera:
        _leave_part(key, scene)
    photo = photo or images.get(ImageRole.PHOTO)
    if camera is not None and photo is not None:
        set_background_photo(camera, photo)
    built = BuiltObject(collection, obj, camera, world, scene, material)
    _set_scene(built, options, result)
    reset_view(material)  # the layer of highlights is valid for the present view
    return built


def _ensure_materials(
    key: str,
    existing: bpy.types.Object | None,
    maps: MaterialMaps,
    specular: SpecularSettings,
) -> bpy.types.Material:
    """The material of an object; those of its copies, which show the same images, follow."""
    if existing is None:
        return ensure_material(key, maps, specular, find_tagged(bpy.data.materials, key, MATERIAL))
    material = ensure_material(key, maps, specular, find_material(existing))
    for other in materials_of_copies(existing, key):
        is_off = specular.source == "image" and not shows_highlights(other)
        update_material(other, maps, replace(specular, source="lobe") if is_off else specular)
        reset_view(other)
    return material


def _light_before(existing: bpy.types.Object | None, options: BuildOptions) -> ShownLight:
    """The light of an object that is updated, unless another one is requested than before."""
    if existing is not None and _stored_option(existing, "sun", options.sun) == options.sun:
        return shown_light(existing)
    return ShownLight(options.sun)


def _stored_option(obj: bpy.types.Object | None, name: str, default: bool) -> bool:
    """An option with which an object was built last."""
    stored = {} if obj is None else json.loads(obj.get("isc_options", "{}"))
    return bool(stored.get(name, default))


def _leave_part(key: str, scene: bpy.types.Scene) -> None:
    """Exclude the photo's light and camera, which were included for the sun."""
    part = find_tagged(bpy.data.collections, key, LIGHT_AND_CAMERA)
    if part is not None:
        use_part(part, scene, False)


def _lamps(result: ResultArrays) -> tuple[np.ndarray, np.ndarray]:
    """Directions and irradiances (K, 3) of the lamps of the highlights."""
    if result.lamp_direction is None or result.lamp_strength is None:
        return _NO_LAMPS, _NO_LAMPS
    return result.lamp_direction, result.lamp_strength


def _choose_key(result: ResultArrays, options: BuildOptions, photo: bpy.types.Image | None) -> str:
    """The name, numbered if the object of another photo has it: photos may share a file name."""
    name = options.name or result.name
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
    if not options.own_scene and scene.library is not None:
        raise InputError(
            f"the scene {scene.name} is linked from another file and cannot be changed: "
            "enable New Scene"
        )
    require_color_spaces(COLOR, DATA, SRGB)
    require_local(key)
    obj = find_tagged(bpy.data.objects, key, OBJECT)
    if obj is not None and obj.mode != "OBJECT":
        raise InputError(f"{obj.name} is being edited: return to Object Mode first")


def _mesh_number(key: str) -> int:
    """Blender's number of the mesh of an object; 0 if there is no object."""
    obj = find_tagged(bpy.data.objects, key, OBJECT)
    return 0 if obj is None else int(obj.data.session_uid)


def _ensure_object(
    key: str,
    prepared: PreparedObject,
    mesh: bpy.types.Mesh,
    material: bpy.types.Material,
) -> bpy.types.Object:
    obj, shadows = find_tagged(bpy.data.objects, key, OBJECT), prepared.options.own_shadows
    store_normals(mesh)
    if obj is None:
        mesh.name = datablock_name(key)
        obj = tag(bpy.data.objects.new(datablock_name(key), mesh), key, OBJECT)
        shadows = not prepared.options.own_scene if shadows is None else shadows
    else:
        obj.shape_key_clear()
        if (choice := shading_choice(obj.data)) is not None:
            shade(mesh, choice)
        replace_mesh(obj.data, mesh)
    tag(mesh, key, "mesh")
    store_checksum(mesh, prepared.checksum)
    store_window(mesh, prepared.result)
    if shadows is not None:
        obj.visible_shadow = obj.visible_diffuse = shadows
    if not mesh.materials:
        mesh.materials.append(material)
    return obj


def _position(
    obj: bpy.types.Object,
    options: BuildOptions,
    scene: bpy.types.Scene,
    matrix: Matrix | None,
    bounds: np.ndarray | None,
) -> None:
    if matrix is not None:
        obj.matrix_basis = matrix
    elif not options.own_scene:
        obj.location = free_location(obj, scene, bounds)


def _ensure_camera_and_light(
    key: str,
    collection: bpy.types.Collection,
    obj: bpy.types.Object,
    result: ResultArrays,
    options: BuildOptions,
    scene: bpy.types.Scene,
    keep_sun: bool,
) -> bpy.types.Object | None:
    """The photo's camera; in a shared scene, in a collection with a sun, if requested."""
    if not options.own_scene and not (options.light_and_camera or options.set_camera):
        return find_tagged(bpy.data.objects, key, "camera")
    if not options.own_scene:
        shown = options.set_camera or options.sun
        collection = ensure_optional_part(key, collection, scene, LIGHT_AND_CAMERA, shown)
        if options.light_and_camera and not options.sun and not keep_sun:
            ensure_sun(key, collection, result.sun_direction, result.sun_strength)
    place = world_matrix(obj)
    return ensure_camera(
        key, collection, result, options.size_metres, place, options.photo_resolution
    )


def _gloss_basis(
    result: ResultArrays, images: dict[ImageRole, bpy.types.Image]
) -> GlossBasis | None:
    if ImageRole.PLAIN_BASE_COLOR not in images:
        return None
    return GlossBasis(
        images[ImageRole.PLAIN_BASE_COLOR],
        images[ImageRole.VIEW_NORMAL],
        recovered_light(result).numbers,
        images.get(ImageRole.SPECULAR_VARIATION),
    )


def _remove_unused(key: str, images: dict[ImageRole, bpy.types.Image]) -> None:
    """Remove the textures of an earlier build that this one lacks: its mesh had fewer triangles, or
    a soft rim, or its material gloss.
    """
    for role in _OPTIONAL_TEXTURES:
        old = find_tagged(bpy.data.images, key, role)
        if role not in images and old is not None and old.users == 0:
            bpy.data.images.remove(old)


def _set_scene(built: BuiltObject, options: BuildOptions, result: ResultArrays) -> None:
    """Set what was requested; in the object's own scene all of it, unless the user has changed it
    since.
    """
    scene, own = built.scene, options.own_scene
    if options.set_world or (own and scene.world is None):
        if scene.world is not None and not is_isc_datablock(scene.world):
            scene.world.use_fake_user = True  # else it would not be saved
        scene.world = built.world
    if options.set_camera or (own and scene.camera is None):
        scene.camera = built.camera
    width, height = map(int, result.photo_size)
    size = (width, height) if options.photo_resolution else result.size
    given = tuple(scene.get(_RESOLUTION, ()))
    is_given = given == (scene.render.resolution_x, scene.render.resolution_y) != size
    if options.set_resolution or (own and (not given or is_given)):
        set_render_size(scene, size)
        scene[_RESOLUTION] = size
    if options.set_view_transform:
        use_standard_view(scene)
