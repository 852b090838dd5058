"""Building: repeatable, changes only its own datablocks, survives files, refuses in one line."""

import importlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb
from tests.addon.scene_fixture import bump, write_result
from tests.addon.scene_render import pixels

KINDS = (
    "objects",
    "meshes",
    "materials",
    "images",
    "textures",
    "worlds",
    "scenes",
    "collections",
    "node_groups",
    "cameras",
    "lights",
)


def build(result: ResultArrays, scene: Any = None, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options), scene=scene)


@pytest.fixture
def result(bump_folder: Path) -> ResultArrays:
    return read_result(bump_folder)


def census(bpy: Any) -> dict[str, list[str]]:
    return {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in KINDS}


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"sun": True},
        {"displacement": True},
        {"back": "rounded"},
        {"specular_from": "image"},
        {"own_scene": False},
    ],
    ids=str,
)
def test_building_again_adds_nothing(
    blender: Any, result: ResultArrays, options: dict[str, Any]
) -> None:
    build(result, **options)
    once = census(blender)
    build(result, **options)
    assert census(blender) == once
    assert not [
        block.name for kind in KINDS for block in getattr(blender.data, kind) if block.users == 0
    ]


def test_changed_options_leave_nothing_behind(blender: Any, result: ResultArrays) -> None:
    build(result)
    plain = census(blender)
    build(result, sun=True, displacement=True, specular_from="image", size_metres=0.3)
    build(result, back="flat")
    build(result)
    changed = {kind: names for kind, names in census(blender).items() if names != plain[kind]}
    assert set(changed) <= {"node_groups"}, "a group without users goes when the file is saved"


@pytest.mark.slow
def test_another_resolution_updates_the_same_object(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    built = build(result)
    once = census(blender)
    larger = read_result(write_result(tmp_path / "bump", bump(100, 130, (45.0, 60.0))))
    again = build(larger)
    assert (
        again.object == built.object
        and again.material == built.material
        and census(blender) == once
    )
    assert len(again.object.data.vertices) == len(larger.vertices)
    assert tuple(again.object["isc_map_height"].size) == (130, 100)
    assert (again.scene.render.resolution_x, again.scene.render.resolution_y) == (130, 100)


def test_two_photos_become_two_objects(blender: Any, result: ResultArrays) -> None:
    first, second = build(result, name="one"), build(result, name="two")
    assert (
        first.object != second.object
        and first.scene != second.scene
        and first.world != second.world
    )
    assert first.object.data != second.object.data and len(blender.data.node_groups) == 1


def of_photo(result: ResultArrays, letter: str) -> ResultArrays:
    """The same result as if it were that of another photo of the same name."""
    source = {**result.description["input"], "sha256": 64 * letter}
    return replace(result, description={**result.description, "input": source})


def test_photos_of_one_name_do_not_replace_each_other(blender: Any, result: ResultArrays) -> None:
    """Cameras count from DSC0001 in every folder."""
    results = [of_photo(result, letter) for letter in "abc"]
    made = [build(one) for one in results]
    assert [one.object["isc_key"] for one in made] == ["bump", "bump-2", "bump-3"]
    assert [one.object["isc_photo_sha256"][0] for one in made] == ["a", "b", "c"]
    assert (
        len(
            {one.object.data for one in made}
            | {one.material for one in made}
            | {one.scene for one in made}
        )
        == 9
    )
    once = census(blender)
    assert [build(one).object for one in results] == [one.object for one in made] and census(
        blender
    ) == once


def test_a_photo_without_a_hash_is_identified_by_its_name(
    blender: Any, result: ResultArrays
) -> None:
    thing = build(of_photo(result, "a")).object
    assert build(replace(result, description={}), name="bump").object == thing


def test_an_edited_image_is_the_same_photo(blender: Any, result: ResultArrays) -> None:
    from blender_addon.scene import BuildOptions, build_object

    first, second = (blender.data.images.new("bump", 8, 8) for _ in range(2))
    thing = build_object(of_photo(result, "a"), BuildOptions(name="bump"), photo=first).object
    thing["isc_source_image"] = first
    assert (
        build_object(of_photo(result, "b"), BuildOptions(name="bump"), photo=first).object == thing
    )
    assert (
        build_object(of_photo(result, "b"), BuildOptions(name="bump"), photo=second).object != thing
    )


NAMES = [
    "a/b\\c",
    "чашка 杯 ☕",
    "x" * 300,
    "é" * 100,
    "  ",
    "ISC Dichromatic",
    "con.png",
    '"quoted"\n',
]


@pytest.mark.parametrize("name", NAMES)
def test_any_name_is_supported(blender: Any, result: ResultArrays, name: str) -> None:
    built = build(result, name=name)
    once = census(blender)
    assert build(result, name=name).object == built.object and census(blender) == once
    assert built.object["isc_key"] == name
    start = name.encode()[:20].decode("utf-8", "ignore")
    assert all(
        part.name.startswith(start)
        for part in (built.object, built.camera, built.collection, built.world, built.material)
    )
    assert built.camera.name.endswith("camera")


def test_names_that_start_alike_are_different_objects(blender: Any, result: ResultArrays) -> None:
    first, second = build(result, name="x" * 300), build(result, name="x" * 300 + "y")
    assert first.object != second.object
    assert build(result, name="x" * 300).object == first.object


def test_renamed_datablocks_are_found(blender: Any, result: ResultArrays) -> None:
    built = build(result)
    for part, name in (
        (built.object, "vase"),
        (built.collection, "shelf"),
        (built.material, "clay"),
        (built.world, "sky"),
    ):
        part.name = name
    once = census(blender)
    build(result)
    assert census(blender) == once and built.object.name == "vase"


def state(scene: Any) -> tuple[Any, ...]:
    render, view = scene.render, scene.view_settings
    size = (
        render.resolution_x,
        render.resolution_y,
        render.resolution_percentage,
        render.pixel_aspect_x,
        render.engine,
    )
    return (
        scene.world,
        scene.camera,
        *size,
        render.film_transparent,
        view.view_transform,
        view.look,
        view.exposure,
        view.gamma,
    )


def user_scene(bpy: Any) -> Any:
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("mine")
    scene.camera = bpy.data.objects.new("my camera", bpy.data.cameras.new("my camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x, scene.view_settings.exposure = 777, 0.5
    return scene


@pytest.mark.parametrize("own", [True, False])
def test_the_users_scene_stays_as_it_is(blender: Any, result: ResultArrays, own: bool) -> None:
    scene = user_scene(blender)
    before, objects = state(scene), set(scene.objects)
    built = build(result, own_scene=own, sun=True)
    assert state(scene) == before
    assert (set(scene.objects) == objects) == own
    assert (built.scene == scene) != own and built.object.name in built.scene.objects
    if own:
        assert built.scene.world == built.world and built.scene.camera == built.camera
        assert (
            built.scene.view_settings.view_transform == "Standard"
            and built.scene.render.film_transparent
        )


def test_an_update_keeps_what_the_user_changed_in_its_own_scene(
    blender: Any, result: ResultArrays
) -> None:
    scene = build(result, all_maps=False).scene
    build(result, all_maps=False, photo_resolution=True)
    blender.context.window.scene = scene
    user_scene(blender)
    scene.view_settings.view_transform = "AgX"
    before = state(scene)
    build(result, all_maps=False)
    assert state(scene) == before
    blender.data.worlds.remove(scene.world)
    built = build(result, all_maps=False)
    assert scene.world == built.world and scene.camera != built.camera


def test_a_copy_of_its_own_scene_is_another_scene(blender: Any, result: ResultArrays) -> None:
    scene = build(result, all_maps=False).scene
    copy = scene.copy()
    copy.name, copy.camera = "a first one", None
    build(result, scene=scene, all_maps=False)
    assert copy.camera is None and scene.camera is not None
    assert build(result, scene=copy, all_maps=False).scene == copy


CHANGES: dict[str, Callable[[Any, Any], bool]] = {
    "set_world": lambda scene, built: scene.world == built.world,
    "set_camera": lambda scene, built: scene.camera == built.camera,
    "set_resolution": lambda scene, built: (
        (scene.render.resolution_x, scene.render.resolution_y) == (88, 64)
    ),
    "set_view_transform": lambda scene, built: (
        scene.view_settings.view_transform == "Standard" and scene.view_settings.exposure == 0
    ),
}


@pytest.mark.parametrize("chosen", CHANGES)
def test_each_option_changes_one_setting_of_the_scene(
    blender: Any, result: ResultArrays, chosen: str
) -> None:
    scene = user_scene(blender)
    scene.view_settings.view_transform = "AgX"
    built = build(result, own_scene=False, **{chosen: True})
    assert {name for name, changed in CHANGES.items() if changed(scene, built)} == {chosen}


def test_a_world_that_is_replaced_is_saved(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    scene = blender.context.scene
    scene.world = blender.data.worlds.new("studio")
    build(result, own_scene=False)
    assert not scene.world.use_fake_user
    for _ in range(2):
        built = build(result, own_scene=False, set_world=True)
        assert scene.world == built.world and not built.world.use_fake_user
    blender.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    blender.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert "studio" in blender.data.worlds


def test_a_new_object_is_seen_although_its_former_collection_is_excluded(
    blender: Any, result: ResultArrays
) -> None:
    built = build(result, own_scene=False)
    entries = blender.context.view_layer.layer_collection.children
    entries[built.collection.name].exclude = True
    assert build(result, own_scene=False).object.name not in blender.context.view_layer.objects
    assert entries[built.collection.name].exclude, "an update keeps what the user has set"
    blender.data.objects.remove(built.object)
    built = build(result, own_scene=False)
    assert built.object.name in blender.context.view_layer.objects
    (part,) = entries[built.collection.name].children
    assert part.exclude, "the photo's sun does not shine"


def test_a_scene_can_be_chosen(blender: Any, result: ResultArrays) -> None:
    other = blender.data.scenes.new("other")
    assert build(result, scene=other, own_scene=False).object.name in other.objects
    assert not blender.context.scene.objects


def test_provenance_is_stored(blender: Any, result: ResultArrays) -> None:
    built = build(result, size_metres=0.25)
    for block in (built.object, built.collection):
        assert (block["isc_photo"], block["isc_model"], block["isc_separator"]) == (
            "bump.png",
            "mdr",
            "isc",
        )
        assert block["isc_photo_sha256"] == "0" * 64 and block["isc_version"] == "0.1.0"
        assert json.loads(block["isc_decomposition"]) == result.description
        assert json.loads(block["isc_options"])["size_metres"] == 0.25


def test_datablocks_of_isc_are_recognised(blender: Any, result: ResultArrays) -> None:
    from blender_addon.scene import find_built, is_isc_datablock

    built = build(result, sun=True)
    sun = next(thing for thing in built.collection.objects if thing.type == "LIGHT")
    assert (
        find_built(built.object) == built
        and find_built(built.camera) == built
        and find_built(sun) == built
    )
    stranger = blender.data.objects.new("cube", None)
    assert (
        find_built(stranger) is None
        and find_built(None) is None
        and not is_isc_datablock(stranger)
        and not is_isc_datablock(None)
        and is_isc_datablock(built.object)
    )


def check_loaded(bpy: Any, thing: Any, result: ResultArrays) -> None:
    """An object that came out of a file is whole: mesh, normals, material, images with their exact
    values.
    """
    mesh = thing.data
    assert (
        len(mesh.vertices) == len(result.vertices)
        and mesh.has_custom_normals
        and "confidence" in mesh.attributes
    )
    material = mesh.materials[0]
    group = next(node for node in material.node_tree.nodes if node.type == "GROUP")
    assert group.node_tree["isc_group"] == "ISC Dichromatic"
    base = group.inputs["Base Color"].links[0].from_node.image
    assert base.colorspace_settings.name == "sRGB" and base.packed_file
    codes = np.rint(255 * linear_to_srgb(np.clip(result.base_color, 0, 1)))
    np.testing.assert_array_equal(np.rint(255 * pixels(base)[..., :3]), codes)
    for name in ("diffuse", "reflectance", "shading", "normal"):
        np.testing.assert_array_equal(
            pixels(thing[f"isc_map_{name}"])[..., :3], getattr(result, name)
        )
    assert json.loads(thing["isc_decomposition"]) == result.description


def save(bpy: Any, path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False)


def test_everything_survives_saving_and_loading(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    from blender_addon.scene import find_built

    build(result, sun=True)
    once = census(blender)
    save(blender, tmp_path / "saved.blend")
    blender.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert census(blender) == once
    built = find_built(next(thing for thing in blender.data.objects if thing.type == "MESH"))
    assert built is not None
    check_loaded(blender, built.object, result)
    sky = next(node for node in built.world.node_tree.nodes if node.type == "TEX_ENVIRONMENT").image
    np.testing.assert_array_equal(pixels(sky)[..., :3], result.environment_map)
    assert built.scene.camera == built.camera and built.world["isc_rotation"] == 90
    (shown,) = built.camera.data.background_images
    assert np.array_equal(pixels(shown.image)[..., 3] > 0.5, result.mask)
    build(result, sun=True)
    assert census(blender) == once


@pytest.mark.parametrize("kind", ["objects", "collections", "scenes"])
def test_everything_survives_appending(
    blender: Any, result: ResultArrays, tmp_path: Path, kind: str
) -> None:
    from blender_addon.scene import find_built

    name = {"objects": "object", "collections": "collection", "scenes": "scene"}[kind]
    wanted = getattr(build(result), name).name
    save(blender, tmp_path / "saved.blend")
    blender.ops.wm.read_factory_settings(use_empty=True)
    with blender.data.libraries.load(str(tmp_path / "saved.blend"), link=False) as (_, into):
        setattr(into, kind, [wanted])
    thing = next(thing for thing in blender.data.objects if thing.type == "MESH")
    check_loaded(blender, thing, result)
    assert bool(blender.data.cameras) == (kind != "objects") and thing["isc_world"] in set(
        blender.data.worlds
    )
    found = find_built(thing)
    assert found is not None and found.object == thing and found.world == thing["isc_world"]
    assert (found.camera is None) == (kind == "objects")
    assert build(result).object == thing, "what was appended is updated, too"


def link(bpy: Any, path: Path, kind: str, name: str) -> Any:
    with bpy.data.libraries.load(str(path), link=True) as (_, into):
        setattr(into, kind, [name])
    return getattr(into, kind)[0]


def test_linked_datablocks_are_refused_and_nothing_changes(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    name = build(result).collection.name
    save(blender, tmp_path / "saved.blend")
    blender.ops.wm.read_factory_settings(use_empty=True)
    collection = link(blender, tmp_path / "saved.blend", "collections", name)
    blender.context.scene.collection.children.link(collection)
    before = census(blender)
    for options in ({}, {"own_scene": False}):
        with pytest.raises(InputError, match="linked from") as caught:
            build(result, **options)
        assert "Make Local" in str(caught.value) and "\n" not in str(caught.value)
    assert census(blender) == before
    built = build(result, name="another name")
    assert built.object.library is None and built.material.library is None
    group = next(node for node in built.material.node_tree.nodes if node.type == "GROUP").node_tree
    assert group.library is None, "the linked file's group was used"


def test_a_linked_scene_is_refused(blender: Any, result: ResultArrays, tmp_path: Path) -> None:
    blender.context.scene.name = "far"
    save(blender, tmp_path / "other.blend")
    blender.ops.wm.read_factory_settings(use_empty=True)
    scene = link(blender, tmp_path / "other.blend", "scenes", "far")
    before = census(blender)
    with pytest.raises(InputError, match="scene far is linked"):
        build(result, scene=scene, own_scene=False)
    assert census(blender) == before


@pytest.mark.parametrize("size", [0.0, -1.0, 1e9, float("nan"), float("inf")])
def test_an_invalid_size_is_refused_and_nothing_changes(
    blender: Any, result: ResultArrays, size: float
) -> None:
    before = census(blender)
    with pytest.raises(InputError, match="metres.* above 0 and below 1e6"):
        build(result, size_metres=size)
    assert census(blender) == before


@pytest.mark.parametrize("options", [{"back": "round"}, {"triangles": -1}], ids=str)
def test_an_unknown_back_is_refused(
    blender: Any, result: ResultArrays, options: dict[str, Any]
) -> None:
    with pytest.raises(InputError, match="choose|keeps"):
        build(result, **options)
    assert not blender.data.objects


def test_a_colour_configuration_without_our_spaces_is_refused(
    blender: Any, result: ResultArrays, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.import_module("blender_addon.scene.build"), "DATA", "Cinema Data")
    before = census(blender)
    with pytest.raises(InputError, match="no space 'Cinema Data'"):
        build(result)
    assert census(blender) == before


def test_an_object_that_is_being_edited_is_refused(blender: Any, result: ResultArrays) -> None:
    built = build(result, own_scene=False)
    blender.context.view_layer.objects.active = built.object
    blender.ops.object.mode_set(mode="EDIT")
    with pytest.raises(InputError, match="Object Mode"):
        build(result, own_scene=False)
    blender.ops.object.mode_set(mode="OBJECT")
    build(result, own_scene=False)


def test_deleted_parts_are_made_again(blender: Any, result: ResultArrays) -> None:
    built = build(result)
    once = census(blender)
    blender.data.objects.remove(built.camera)
    blender.data.worlds.remove(built.world)
    built.collection.objects.unlink(built.object)
    blender.data.cameras.remove(blender.data.cameras[0])
    build(result)
    assert census(blender) == once


def test_a_mesh_with_shape_keys_is_filled_anew(blender: Any, result: ResultArrays) -> None:
    built = build(result)
    built.object.shape_key_add(name="Basis")
    built.object.shape_key_add(name="bent")
    build(replace(result, faces=result.faces[:100]))
    assert built.object.data.shape_keys is None and len(built.object.data.polygons) == 100


def test_unrelated_datablocks_of_the_same_names_are_not_changed(
    blender: Any, result: ResultArrays
) -> None:
    cube = blender.data.objects.new("bump", blender.data.meshes.new("bump"))
    clay, group = (
        blender.data.materials.new("bump"),
        blender.data.node_groups.new("ISC Dichromatic", "ShaderNodeTree"),
    )
    built = build(result)
    assert (
        built.object != cube
        and built.material != clay
        and not cube.data.vertices
        and not group.nodes
    )
    assert (
        next(node for node in built.material.node_tree.nodes if node.type == "GROUP").node_tree
        != group
    )


def test_own_shadows_follow_the_scene(blender: Any, result: ResultArrays) -> None:
    """The recovered shading holds the photo's shadows; in a shared scene users expect an object
    to cast one.
    """
    assert not build(result, name="alone").object.visible_shadow
    thing = build(result, name="among others", own_scene=False).object
    assert thing.visible_shadow
    thing.visible_shadow = False
    assert not build(result, name="among others", own_scene=False).object.visible_shadow, (
        "what people set stays"
    )
    assert build(result, name="alone", own_shadows=True).object.visible_shadow


def test_an_object_of_an_earlier_version_is_updated(blender: Any, result: ResultArrays) -> None:
    """Its environment map has the former role."""
    built = build(result)
    image = next(
        image for image in blender.data.images if image.get("isc_role") == "environment_map"
    )
    image["isc_role"] = "sky"
    once = census(blender)
    assert build(result).object == built.object and census(blender) == once
