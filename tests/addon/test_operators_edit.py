"""Edits of a built object: reflectance, gains, light, export; and their errors."""

import colorsys
import json
import shutil
import struct
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from mathutils import Vector  # noqa: E402 (after the skip)

from blender_addon.files.result_arrays import read_result  # noqa: E402
from blender_addon.materials.color_bake import recolour_reflectance  # noqa: E402
from blender_addon.materials.edit_nodes import dichromatic_node  # noqa: E402
from blender_addon.materials.material import set_specular_gain  # noqa: E402
from blender_addon.operators.edit import ISC_OT_dichromatic, ISC_OT_recolour  # noqa: E402
from blender_addon.operators.export import export_object  # noqa: E402
from blender_addon.scene.build import build_object  # noqa: E402
from blender_addon.scene.built_object import BuiltObject, find_built  # noqa: E402
from blender_addon.scene.collection import find_layer_collection  # noqa: E402
from blender_addon.scene.copies import (  # noqa: E402
    find_original,
    is_copy,
    objects_sharing_material,
)
from blender_addon.scene.preparation import BuildOptions  # noqa: E402
from blender_addon.scene.world import sun_mix  # noqa: E402
from isc_core.imaging.srgb import linear_to_srgb  # noqa: E402
from tests.addon.scene_render import render  # noqa: E402


@pytest.fixture
def built(addon: Any, bump_folder: Path) -> BuiltObject:
    """The bump in its own scene, active, with the fitted lobe."""
    settings = addon.context.scene.isc
    settings.own_scene, settings.specular_from, settings.all_maps = True, "lobe", True
    addon.ops.isc.import_result(directory=str(bump_folder))
    found = find_built(addon.context.object)
    assert found is not None
    return found


def sockets(built: BuiltObject) -> dict[str, float]:
    node = dichromatic_node(built.material)
    assert node is not None
    names = ("Hue", "Saturation", "Value", "Diffuse Gain", "Specular Gain", "Roughness")
    return {name: node.inputs[name].default_value for name in names}


def error_of(operator: Any, **options: Any) -> str:
    """The error of an operator."""
    with pytest.raises(RuntimeError) as caught:
        operator(**options)
    return str(caught.value).strip().removeprefix("Error: ")


def sun_of(built: BuiltObject) -> Any:
    return next((obj for obj in built.collection.objects if obj.type == "LIGHT"), None)


def test_recolouring_changes_the_reflectance_only(
    addon: Any, built: BuiltObject, bump_folder: Path, tmp_path: Path
) -> None:
    before = sockets(built)
    assert addon.ops.isc.recolour(hue=0.5, saturation=0.0, value=0.5) == {"FINISHED"}
    assert sockets(built) == {**before, "Saturation": 0.0, "Value": 0.5}
    result = read_result(bump_folder)
    paint = render(built.scene, tmp_path)["Diffuse Color"]
    inside = result.mask & (result.confidence > 0.8)
    np.testing.assert_allclose(
        paint[inside],
        0.5 * result.base_color[inside].max(-1, keepdims=True).repeat(3, -1),
        rtol=0.02,
    )


def test_gains_apply_to_both_sources_of_highlights(addon: Any, bump_folder: Path) -> None:
    addon.context.scene.isc.specular_from = "image"
    addon.ops.isc.import_result(directory=str(bump_folder))
    material = find_built(addon.context.object).material  # type: ignore[union-attr]
    assert addon.ops.isc.dichromatic(diffuse_gain=0.25, specular_gain=0.5) == {"FINISHED"}
    groups = [node for node in material.node_tree.nodes if node.type == "GROUP"]
    gains = [
        node.inputs["Specular Gain"].default_value
        for node in groups
        if "Specular Gain" in node.inputs
    ]
    node = dichromatic_node(material)
    assert (
        gains == [0.5, 0.5]
        and node is not None
        and node.inputs["Diffuse Gain"].default_value == 0.25
    )


def test_an_edit_starts_with_the_current_values(addon: Any, built: BuiltObject) -> None:
    """From a panel: the redo panel shows the object's values, not the defaults.

    Without a window, Blender never asks for that.
    """
    addon.ops.isc.recolour(hue=0.2, saturation=0.7, value=1.5)
    addon.ops.isc.dichromatic(diffuse_gain=0.3, specular_gain=0.4)
    for kind, wanted in (
        (ISC_OT_recolour, {"hue": 0.2, "saturation": 0.7, "value": 1.5}),
        (ISC_OT_dichromatic, {"diffuse_gain": 0.3, "specular_gain": 0.4}),
    ):
        operator = SimpleNamespace(execute=lambda context: {"FINISHED"})
        operator.read = partial(kind.read, operator)
        assert kind.invoke(operator, addon.context, None) == {"FINISHED"}
        assert {name: getattr(operator, name) for name in wanted} == pytest.approx(wanted)


def test_the_sun_has_the_dominant_direction(
    addon: Any, built: BuiltObject, bump_folder: Path
) -> None:
    result = read_result(bump_folder)
    assert sun_of(built) is None
    assert addon.ops.isc.relight(light="OPTIMAL") == {"FINISHED"}
    sun = sun_of(built)
    x, y, z = result.sun_direction
    toward = sun.rotation_quaternion.to_matrix() @ Vector((0, 0, 1))
    np.testing.assert_allclose(toward, (x, -z, y), atol=1e-5)
    np.testing.assert_allclose(
        sun.data.energy * np.array(sun.data.color), result.sun_strength, rtol=1e-5
    )


def test_the_sun_takes_a_custom_direction(addon: Any, built: BuiltObject) -> None:
    """Right, away from the viewer, up: Blender's own axes, as the camera looks along +Y."""
    addon.ops.isc.relight(light="OPTIMAL")
    energy = sun_of(built).data.energy
    assert addon.ops.isc.relight(light="CHOSEN", direction=(0, -3, 0), strength=2) == {"FINISHED"}
    sun = sun_of(built)
    toward = sun.rotation_quaternion.to_matrix() @ Vector((0, 0, 1))
    np.testing.assert_allclose(toward, (0, -1, 0), atol=1e-6)
    assert sun.data.energy == pytest.approx(2 * energy)
    assert "direction is zero" in error_of(
        addon.ops.isc.relight, light="CHOSEN", direction=(0, 0, 0)
    )


@pytest.mark.parametrize("own", [True, False])
def test_an_update_keeps_the_light(addon: Any, bump_folder: Path, own: bool) -> None:
    """The sun as it was left, or the new estimate of one that was not changed, or none."""
    result, options = read_result(bump_folder), BuildOptions(own_scene=own)
    brighter = replace(result, sun_strength=2 * result.sun_strength)

    def light(built: BuiltObject) -> tuple[Any, ...]:
        sun, mix = addon.data.objects.get("bump sun"), sun_mix(built.world)
        assert mix is not None
        lit = None if sun is None else (tuple(sun.rotation_quaternion), sun.data.energy)
        return mix.sun, lit, *mix.ambient

    built = build_object(result, options)
    addon.context.window.scene = built.scene
    addon.context.view_layer.objects.active = built.object
    recovered = light(built)
    assert not recovered[0] and light(build_object(result, options)) == recovered
    addon.ops.isc.relight(light="OPTIMAL")
    estimated = light(built)
    assert estimated[0]
    updated = light(build_object(brighter, options))
    assert updated[1][1] == pytest.approx(2 * estimated[1][1]) and updated[0]
    addon.ops.isc.relight(light="CHOSEN", direction=(1, 0, 0), ambient=0.5)
    chosen = light(built)
    assert light(build_object(result, options)) == chosen != updated
    addon.data.objects["bump sun"].data.energy = 7
    assert light(build_object(brighter, options))[1] == (chosen[1][0], 7)
    assert light(build_object(result, replace(options, sun=True))) == estimated, "as requested"
    addon.ops.isc.relight(light="RECOVERED")
    assert not light(build_object(result, replace(options, sun=True)))[0]


def shared(addon: Any, folder: Path) -> BuiltObject:
    """The bump in the scene of the user."""
    addon.context.scene.isc.own_scene = False
    addon.ops.isc.import_result(directory=str(folder))
    found = find_built(addon.context.object)
    assert found is not None
    return found


def test_the_sun_shines_in_the_scene_that_is_edited(addon: Any, bump_folder: Path) -> None:
    made = shared(addon, bump_folder)
    first, other = addon.context.scene, addon.data.scenes.new("other")
    other.collection.objects.link(made.object)
    addon.context.window.scene = other
    addon.context.view_layer.objects.active = made.object
    assert addon.ops.isc.relight(light="OPTIMAL") == {"FINISHED"}
    sun = addon.data.objects["bump sun"]
    assert set(sun.users_scene) == {first, other}, "there it waits with the camera"
    lights = addon.data.collections.new("lights")
    other.collection.children.link(lights)
    other.collection.objects.unlink(sun)
    lights.objects.link(sun)
    addon.ops.isc.relight(light="CHOSEN", direction=(1, 0, 0))
    assert sun.name not in other.collection.objects, "the user moved it"


def test_a_full_copy_of_the_scene_has_its_own_light(addon: Any, built: BuiltObject) -> None:
    addon.ops.scene.new(type="FULL_COPY")
    scene = addon.context.scene
    copy = next(obj for obj in scene.objects if obj.type == "MESH")
    addon.context.view_layer.objects.active = copy
    assert scene not in (None, built.scene) and scene.world != built.world
    assert addon.ops.isc.relight(light="OPTIMAL") == {"FINISHED"}
    mixes = sun_mix(scene.world), sun_mix(built.world)
    assert [mix is not None and mix.sun for mix in mixes] == [True, False]
    assert any(obj.type == "LIGHT" for obj in scene.objects)
    assert addon.ops.isc.relight(light="RECOVERED") == {"FINISHED"}
    assert not sun_mix(scene.world).sun  # type: ignore[union-attr]


def test_the_photos_light_stays_when_the_sun_is_removed(addon: Any, bump_folder: Path) -> None:
    made = shared(addon, bump_folder)
    part = addon.data.collections["bump light and camera"]
    sun = addon.data.objects["bump sun"]
    before = sun.rotation_quaternion.copy(), sun.data.energy
    addon.ops.isc.relight(light="CHOSEN", direction=(1, 0, 0), strength=3)
    assert sun.name in made.collection.objects and sun.rotation_quaternion != before[0]
    addon.ops.isc.relight(light="RECOVERED")
    assert sun.users_collection == (part,)
    assert sun.rotation_quaternion == before[0] and sun.data.energy == pytest.approx(before[1])
    entry = find_layer_collection(addon.context.view_layer.layer_collection, part)
    assert entry is not None
    entry.exclude = False
    addon.ops.isc.relight(light="RECOVERED")
    assert "bump sun" not in addon.data.objects, "it was in sight"


def test_a_library_override_has_its_sun_in_the_scene(
    addon: Any, bump_folder: Path, tmp_path: Path
) -> None:
    shared(addon, bump_folder)
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    addon.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with addon.data.libraries.load(str(tmp_path / "a.blend"), link=True) as (_, wanted):
        wanted.collections = ["bump"]
    scene, layer = addon.context.scene, addon.context.view_layer
    scene.collection.children.link(wanted.collections[0])
    wanted.collections[0].override_hierarchy_create(scene, layer, do_fully_editable=True)
    layer.objects.active = next(
        obj for obj in addon.data.objects if obj.name == "bump" and obj.library is None
    )
    assert addon.ops.isc.relight(light="OPTIMAL") == {"FINISHED"}
    assert [obj.type for obj in scene.collection.objects] == ["LIGHT"]
    assert addon.ops.isc.relight(light="RECOVERED") == {"FINISHED"}
    assert not scene.collection.objects


def test_an_update_keeps_the_samples_of_its_own_scene(
    addon: Any, built: BuiltObject, bump_folder: Path
) -> None:
    assert built.scene.cycles.samples == 64
    built.scene.cycles.samples = 7
    addon.ops.isc.import_result(directory=str(bump_folder))
    assert built.scene.cycles.samples == 7


def test_the_recovered_light_is_restored(addon: Any, built: BuiltObject, tmp_path: Path) -> None:
    before = render(built.scene, tmp_path, samples=4)["Combined"]
    addon.ops.isc.relight(light="CHOSEN", direction=(1, 0, 0), ambient=0)
    lit = render(built.scene, tmp_path, samples=4)["Combined"][..., :3]
    middle = 38  # of the bump
    assert lit[:, middle + 1 :].mean() > 0.003 and not lit[:, :middle].any(), (
        "light from the right alone"
    )
    addon.ops.isc.relight(light="RECOVERED")
    np.testing.assert_array_equal(render(built.scene, tmp_path, samples=4)["Combined"], before)
    assert sun_of(built) is None


def test_uniform_light_is_scaled(addon: Any, built: BuiltObject, tmp_path: Path) -> None:
    addon.ops.isc.relight(light="OPTIMAL", strength=0, ambient=0)
    assert render(built.scene, tmp_path, samples=4)["Combined"][..., :3].max() < 1e-6
    addon.ops.isc.relight(light="OPTIMAL", strength=0, ambient=1)
    assert render(built.scene, tmp_path, samples=4)["Combined"][..., :3].max() > 0.01


def test_other_objects_are_not_edited(addon: Any, built: BuiltObject) -> None:
    other = addon.data.objects.new("cube", addon.data.meshes.new("cube"))
    addon.context.scene.collection.objects.link(other)
    addon.context.view_layer.objects.active = other
    for name in ("recolour", "dichromatic", "relight", "redo", "export"):
        assert not getattr(addon.ops.isc, name).poll(), name


def test_a_missing_node_group_is_reported(addon: Any, built: BuiltObject) -> None:
    built.material.node_tree.nodes.clear()
    assert "has no node group ISC Dichromatic" in error_of(addon.ops.isc.recolour, hue=0.1)
    reported = []
    button = SimpleNamespace(read=None, report=lambda kind, message: reported.append(message))
    assert ISC_OT_recolour.invoke(button, addon.context, None) == {"CANCELLED"}
    assert "has no node group ISC Dichromatic" in reported[0]


def test_an_object_without_a_request_is_not_decomposed_again(
    addon: Any, built: BuiltObject
) -> None:
    assert "is not in this file: open it, and press Create Object" in error_of(
        addon.ops.isc.redo, max_size=64
    )
    del built.object["isc_request"]
    assert "does not store how it was created" in error_of(addon.ops.isc.redo, max_size=64)


# --- copies ---------------------------------------------------------------------------------------


def copied(bpy: Any, built: BuiltObject, linked: bool = False) -> BuiltObject:
    """The active copy made by Shift D, or by Alt D if `linked`."""
    bpy.ops.object.duplicate(linked=linked)
    copy = find_built(bpy.context.object)
    assert copy is not None and copy.object != built.object, "edits would go to the original"
    return copy


def hue(obj: Any) -> float:
    found = find_built(obj)
    assert found is not None
    return sockets(found)["Hue"]


@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("active", ["copy", "original"])
def test_an_edit_changes_the_active_object_alone(
    addon: Any, built: BuiltObject, tmp_path: Path, linked: bool, active: str
) -> None:
    copy = copied(addon, built, linked)
    other = addon.context.object.copy()
    built.scene.collection.objects.link(other)
    edited = {"copy": copy.object, "original": built.object}[active]
    built.scene.view_layers[0].objects.active = edited
    assert addon.ops.isc.recolour(hue=0.2, saturation=0.5, value=1.0) == {"FINISHED"}
    assert addon.ops.isc.dichromatic(diffuse_gain=0.5, specular_gain=2.0) == {"FINISHED"}
    values = {
        obj: sockets(find_built(obj))["Diffuse Gain"] for obj in (built.object, copy.object, other)
    }  # type: ignore[arg-type]
    assert values == {obj: 0.5 if obj == edited else 1.0 for obj in values}
    assert hue(edited) == pytest.approx(0.2) and sum(hue(obj) == 0.5 for obj in values) == 2
    shown = render(built.scene, tmp_path)["Diffuse Color"]
    assert np.isfinite(shown).all()


def test_a_single_user_material_of_a_copy_is_kept(addon: Any, built: BuiltObject) -> None:
    copy = copied(addon, built)
    copy.object.material_slots[0].material = built.material.copy()
    addon.ops.isc.recolour(hue=0.3)
    assert hue(built.object) == 0.5 and hue(copy.object) == pytest.approx(0.3)
    assert len(addon.data.materials) == 2, "it was its own already"


def test_an_edited_copy_is_never_taken_for_the_original(
    addon: Any, built: BuiltObject, bump_folder: Path
) -> None:
    copy = copied(addon, built)
    addon.ops.isc.recolour(hue=0.3)
    copy.object.name, built.object.name = "a", "z"
    copy.object.material_slots[0].material.name, built.material.name = "a", "z"
    addon.ops.isc.import_result(directory=str(bump_folder))
    assert (
        addon.context.object == built.object
        and hue(copy.object) == pytest.approx(0.3)
        and hue(built.object) == 0.5
    )
    assert find_built(built.object).material == built.material  # type: ignore[union-attr]


def test_an_edited_linked_copy_follows_an_update_of_the_original(
    addon: Any, built: BuiltObject, bump_folder: Path
) -> None:
    copy = copied(addon, built, linked=True)
    addon.ops.isc.recolour(hue=0.3)
    material = find_built(copy.object).material  # type: ignore[union-attr]

    def shown() -> np.ndarray:
        node = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        image = node.inputs["Base Color"].links[0].from_node.image
        assert image.get("isc_role") == "edited_base_color"
        return np.array(image.pixels[:]).reshape(-1, 4)[:, :3]

    before, result = shown(), read_result(bump_folder)
    gray = replace(result, base_color=np.full_like(result.base_color, 0.2), texture=None)
    build_object(gray, BuildOptions(own_scene=True, name="bump"))
    addon.context.view_layer.update()
    assert np.ptp(before.mean(0)) > 0.1 and np.ptp(shown().mean(0)) < 0.01


@pytest.mark.parametrize("single", ["copy", "original"])
def test_an_update_fits_the_gloss_of_every_material(
    addon: Any, built: BuiltObject, bump_folder: Path, single: str
) -> None:
    """All of them show the new images, whatever name they have, and whoever made them single-user.

    Blender's own button copies the tags of ISC, too.
    """
    copy = copied(addon, built).object
    obj = {"copy": copy, "original": built.object}[single]
    obj.material_slots[0].material = built.material.copy()
    obj.material_slots[0].material.name = "a first one"
    dichromatic_node(obj.material_slots[0].material).inputs["Hue"].default_value = 0.2  # type: ignore[union-attr]
    glossy = replace(read_result(bump_folder), specular_level=0.8, roughness=0.4)
    build_object(glossy, BuildOptions(own_scene=True, name="bump"))
    for one in (built.object, copy):
        material = one.material_slots[0].material
        node = dichromatic_node(material)
        assert node is not None and node.inputs["Hue"].default_value == pytest.approx(
            0.2 if one == obj else 0.5
        )
        assert node.inputs["Specular Level"].default_value == pytest.approx(0.8)
        assert node.inputs["Roughness"].default_value == pytest.approx(0.4)
        assert material["isc_fitted_gloss"][0] == pytest.approx(0.8)
    assert built.object["isc_material"] == built.object.material_slots[0].material
    assert len(addon.data.materials) == 2


def test_a_copy_is_not_decomposed_again(addon: Any, built: BuiltObject) -> None:
    copied(addon, built)
    assert "is a copy, and only the original is updated: select bump" in error_of(
        addon.ops.isc.redo, max_size=64
    )
    addon.ops.isc.recolour(hue=0.3)
    addon.data.objects.remove(built.object)
    assert "is a copy, and only the original is updated: press Create Object" in error_of(
        addon.ops.isc.redo, max_size=64
    )


def test_a_copy_is_exported_as_it_is(addon: Any, built: BuiltObject, tmp_path: Path) -> None:
    copy = copied(addon, built)
    addon.ops.isc.dichromatic(diffuse_gain=0.25, specular_gain=1.0)
    copy.object.location.x = 1.0
    assert addon.ops.isc.export(directory=str(tmp_path)) == {"FINISHED"}
    built.scene.view_layers[0].objects.active = built.object
    assert addon.ops.isc.export(directory=str(tmp_path)) == {"FINISHED"}
    mine, original = (
        texture(tmp_path / name / f"{name}.glb")[20, 38] for name in ("bump.001", "bump")
    )
    assert (mine < 0.8 * original).all()


def test_a_foreign_material_of_a_copy_is_not_edited(addon: Any, built: BuiltObject) -> None:
    copy = copied(addon, built)
    copy.object.material_slots[0].material = addon.data.materials.new("mine")
    assert find_built(copy.object) is None and not addon.ops.isc.recolour.poll()


def test_the_users_material_of_an_object_is_exported_and_its_own_is_kept(
    addon: Any, built: BuiltObject, bump_folder: Path, tmp_path: Path
) -> None:
    name = built.material.name
    built.object.material_slots[0].material = addon.data.materials.new("Gold")
    assert "bump has another material: assign bump to it first" in error_of(addon.ops.isc.recolour)
    for kind in ("GLB", "OBJ"):
        assert addon.ops.isc.export(directory=str(tmp_path), file_format=kind) == {"FINISHED"}
    assert surface(tmp_path / "bump" / "bump.glb")["name"] == "Gold"
    assert "newmtl Gold" in (tmp_path / "bump" / "bump.mtl").read_text()
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    addon.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    again = find_built(addon.data.objects["bump"])
    assert again is not None and again.material.name == name
    addon.ops.isc.import_result(directory=str(bump_folder))
    assert [slot.material.name for slot in again.object.material_slots] == ["Gold"]


def test_a_material_is_made_single_user_on_demand(addon: Any, built: BuiltObject) -> None:
    """The panel offers this instead of sliders that would change both."""
    copy = copied(addon, built)
    assert objects_sharing_material(copy.object, copy.material) == [built.object]
    assert addon.ops.isc.own_material() == {"FINISHED"}
    own = find_built(copy.object)
    assert (
        own is not None
        and own.material != built.material
        and not objects_sharing_material(own.object, own.material)
    )


def of_other_photo(folder: Path, copy: Path) -> Path:
    """The same result as if it were that of another photo of the same name."""
    shutil.copytree(folder, copy)
    about = json.loads((copy / "decomposition.json").read_text())
    about["input"]["sha256"] = 64 * "f"
    (copy / "decomposition.json").write_text(json.dumps(about))
    return copy


def appended(bpy: Any, path: Path) -> Any:
    with bpy.data.libraries.load(str(path)) as (_, wanted):
        wanted.objects = ["bump"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.context.view_layer.objects.active = wanted.objects[0]
    return wanted.objects[0]


def test_an_appended_object_of_another_photo_of_the_same_name_is_its_own(
    addon: Any, bump_folder: Path, tmp_path: Path
) -> None:
    addon.context.scene.isc.all_maps = True
    addon.ops.isc.import_result(directory=str(of_other_photo(bump_folder, tmp_path / "bump")))
    addon.data.libraries.write(str(tmp_path / "a.blend"), {addon.context.object}, fake_user=True)
    addon.ops.wm.read_factory_settings(use_empty=True)
    addon.ops.isc.import_result(directory=str(bump_folder))
    first = find_built(addon.context.object)
    others = [appended(addon, tmp_path / "a.blend") for _ in range(2)]
    other = find_built(others[0])
    assert first is not None and other is not None
    assert not is_copy(others[0]) and is_copy(others[1]) and find_original(others[1]) == others[0]
    assert other.world == others[0]["isc_world"] != first.world
    maps = [name for name in others[0].keys() if name.startswith("isc_map_")]  # noqa: SIM118
    before = {name: others[0][name] for name in (*maps, "isc_world")}
    addon.context.view_layer.objects.active = first.object
    addon.ops.isc.import_result(directory=str(bump_folder))
    assert len(maps) == 10 and {name: others[0].get(name) for name in before} == before
    assert other.material.node_tree.nodes["Base Color"].image.get("isc_key") == "bump-2"
    addon.ops.isc.import_result(directory=str(tmp_path / "bump"))
    assert addon.context.object == others[0], "updated, as its number shows"


# --- files ----------------------------------------------------------------------------------------


def test_the_scene_is_exported_without_a_result_folder(
    addon: Any, built: BuiltObject, bump_folder: Path, tmp_path: Path
) -> None:
    import trimesh

    from isc_core.io.exr import read_channels

    addon.ops.isc.relight(light="OPTIMAL")
    material = built.object.data.materials[0]
    assert addon.ops.isc.export(directory=str(tmp_path), maps=True) == {"FINISHED"}
    result = read_result(bump_folder)
    names = {path.name for path in (tmp_path / "bump").glob("*.exr")}
    assert not names & {"lobe.exr", "residual.exr"} and "specular_fit.exr" in names
    channels = read_channels(tmp_path / "bump" / "albedo.exr")
    np.testing.assert_array_equal(
        np.stack([channels[letter] for letter in "RGB"], -1), result.reflectance
    )
    mesh = trimesh.load(tmp_path / "bump" / "bump.glb", force="mesh")
    np.testing.assert_allclose(
        np.ptp(mesh.vertices, axis=0), np.ptp(places(built), axis=0)[[0, 2, 1]], rtol=1e-4
    )
    assert mesh.visual.material.baseColorTexture is not None, "the paint goes with it"
    assert built.object.data.materials[0] == material and "plain" not in addon.data.materials


def texture(path: Path) -> np.ndarray:
    """(H, W, 3) codes of the base colour in a mesh.glb, row 0 at the top."""
    import trimesh

    return np.asarray(
        trimesh.load(path, force="mesh").visual.material.baseColorTexture.convert("RGB")
    ).astype(float)


def surface(path: Path) -> dict[str, Any]:
    """The first material of a mesh.glb, as its JSON has it."""
    data = path.read_bytes()
    tree: dict[str, Any] = json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])
    return tree["materials"][0]


def exported_level(path: Path) -> float:
    """The specular level of a file, from its index of refraction; 1.5 if absent."""
    index = surface(path).get("extensions", {}).get("KHR_materials_ior", {}).get("ior", 1.5)
    return float(((index - 1) / (index + 1)) ** 2 / 0.04)


@pytest.mark.parametrize(
    "edit",
    [
        {},
        {"Hue": 0.72, "Saturation": 0.6, "Value": 1.4, "Diffuse Gain": 0.8},
        {"Saturation": 1.8},
        {"Diffuse Gain": 0.3},
    ],
    ids=str,
)
def test_the_edited_reflectance_is_exported(
    addon: Any, built: BuiltObject, bump_folder: Path, tmp_path: Path, edit: dict[str, float]
) -> None:
    """Coded as sRGB, after the edits: what Cycles shows of the paint is what another program will
    read.
    """
    result, node = read_result(bump_folder), dichromatic_node(built.material)
    assert node is not None
    for name, value in edit.items():
        node.inputs[name].default_value = value
    assert addon.ops.isc.export(directory=str(tmp_path)) == {"FINISHED"}
    codes, inside = texture(tmp_path / "bump" / "bump.glb"), result.mask & (result.confidence > 0.8)
    if not edit:
        np.testing.assert_allclose(
            codes, 255 * linear_to_srgb(np.clip(result.base_color, 0, 1)), atol=0.51
        )
    shown = render(built.scene, tmp_path)["Diffuse Color"][inside]
    np.testing.assert_allclose(codes[inside], 255 * linear_to_srgb(np.clip(shown, 0, 1)), atol=1.0)


def test_recolouring_matches_hsv() -> None:
    paint = np.random.default_rng(3).uniform(0, 1.2, (300, 3))
    paint[:20] = paint[:20, :1]  # greys
    paint[20] = 0
    for hue, saturation in ((0.5, 1.3), (0.1, 0.4), (0.93, 2.0), (0.0, 1.0), (1.0, 0.0)):
        hsv = [colorsys.rgb_to_hsv(*color) for color in paint.tolist()]
        wanted = [
            colorsys.hsv_to_rgb((h + hue + 0.5) % 1, min(s * saturation, 1), v) for h, s, v in hsv
        ]
        np.testing.assert_allclose(
            recolour_reflectance(paint, hue, saturation, 0.7), 0.7 * np.array(wanted), atol=1e-12
        )
    np.testing.assert_array_equal(recolour_reflectance(paint, 0.5, 1.0, 2.0), 2 * paint)


@pytest.mark.parametrize(("source", "level"), [("lobe", 0.3), ("image", 0.3), ("none", 0.0)])
def test_the_fitted_level_is_exported_unless_highlights_are_off(
    addon: Any, bump_folder: Path, tmp_path: Path, source: Any, level: float
) -> None:
    """The photo's highlights, that Blender may show instead, do not fit into the file."""
    fitted = replace(read_result(bump_folder), specular_level=0.6, roughness=0.35)
    made = build_object(fitted, BuildOptions(specular_from=source, own_scene=False))
    set_specular_gain(made.material, 0.5)
    export_object(made, tmp_path)
    path = tmp_path / "bump" / "bump.glb"
    assert exported_level(path) == pytest.approx(level, rel=0.01)
    assert surface(path)["pbrMetallicRoughness"]["roughnessFactor"] == pytest.approx(0.35)


def test_an_unknown_specular_level_is_not_exported(
    addon: Any, bump_folder: Path, tmp_path: Path
) -> None:
    export_object(
        build_object(
            read_result(bump_folder), BuildOptions(specular_from="image", own_scene=False)
        ),
        tmp_path,
    )
    assert exported_level(tmp_path / "bump" / "bump.glb") == 0


def test_a_constant_reflectance_is_exported_and_other_nodes_are_refused(
    addon: Any, built: BuiltObject, tmp_path: Path
) -> None:
    tree, node = built.material.node_tree, dichromatic_node(built.material)
    assert node is not None
    tree.links.remove(node.inputs["Base Color"].links[0])
    node.inputs["Base Color"].default_value = (0.2, 0.4, 0.1, 1)
    node.inputs["Value"].default_value = 0.5
    assert addon.ops.isc.export(directory=str(tmp_path)) == {"FINISHED"}
    factor = surface(tmp_path / "bump" / "bump.glb")["pbrMetallicRoughness"]["baseColorFactor"]
    assert factor == pytest.approx([0.1, 0.2, 0.05, 1])
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], node.inputs["Base Color"])
    assert "is not an image: connect an image texture" in error_of(
        addon.ops.isc.export, directory=str(tmp_path)
    )
    assert "plain" not in addon.data.materials


def test_an_object_without_material_slots_is_exported(
    addon: Any, built: BuiltObject, tmp_path: Path
) -> None:
    built.object.data.materials.clear()
    assert addon.ops.isc.export(directory=str(tmp_path)) == {"FINISHED"}
    assert texture(tmp_path / "bump" / "bump.glb").shape == (64, 88, 3)
    assert not built.object.material_slots


def test_every_slot_of_the_material_is_exported(
    addon: Any, built: BuiltObject, tmp_path: Path
) -> None:
    mine = addon.data.materials.new("mine")
    built.object.data.materials.clear()
    for material in (mine, built.material):
        built.object.data.materials.append(material)
    for face in built.object.data.polygons:
        face.material_index = 1
    assert addon.ops.isc.export(directory=str(tmp_path)) == {"FINISHED"}
    assert texture(tmp_path / "bump" / "bump.glb").shape == (64, 88, 3)
    assert list(built.object.data.materials) == [mine, built.material]


def places(built: BuiltObject) -> np.ndarray:
    """(V, 3) of the object's mesh."""
    values = np.empty(3 * len(built.object.data.vertices), np.float32)
    built.object.data.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


def test_files_have_the_present_name_of_the_object(
    addon: Any, built: BuiltObject, tmp_path: Path
) -> None:
    built.object.name = "Mug: red"
    assert addon.ops.isc.export(directory=str(tmp_path)) == {"FINISHED"}
    assert addon.ops.isc.export_textures(directory=str(tmp_path)) == {"FINISHED"}
    names = {path.name for path in (tmp_path / "Mug_ red").iterdir()}
    assert {"Mug_ red.glb", "Mug_ red_basecolor.png"} <= names
    assert [path.name for path in tmp_path.iterdir()] == ["Mug_ red"]


def test_a_folder_that_cannot_be_written_is_reported(
    addon: Any, built: BuiltObject, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    assert "choose another folder" in error_of(
        addon.ops.isc.export, directory=str(tmp_path / "file")
    )
    assert "No folder is selected" in error_of(addon.ops.isc.export, directory="")


def test_linked_objects_are_not_changed(addon: Any, built: BuiltObject, tmp_path: Path) -> None:
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    addon.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    addon.ops.wm.link(
        directory=str(tmp_path / "a.blend" / "Collection"),
        filename="bump",
        instance_collections=False,
    )
    obj = next(obj for obj in addon.data.objects if obj.type == "MESH")
    addon.context.view_layer.objects.active = obj
    assert obj.library is not None and not addon.ops.isc.recolour.poll()
