"""The layer with the photo's highlights: right as seen first, and off once anything has moved."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.files.result_arrays import read_result  # noqa: E402
from blender_addon.materials.edit_nodes import dichromatic_node, surface_node  # noqa: E402
from blender_addon.materials.material import shows_highlights  # noqa: E402
from blender_addon.operators import live_edits  # noqa: E402
from blender_addon.scene.build import build_object  # noqa: E402
from blender_addon.scene.built_object import BuiltObject  # noqa: E402
from blender_addon.scene.preparation import BuildOptions  # noqa: E402
from isc_core.evaluation.metrics import psnr  # noqa: E402
from tests.addon.scene_render import render  # noqa: E402


@pytest.fixture
def built(addon: Any, bump_folder: Path) -> BuiltObject:
    """The bump, glossy, with the photo's highlights and one lamp, seen once."""
    result = replace(read_result(bump_folder), specular_level=0.8, roughness=0.3)
    options = BuildOptions(own_scene=False, set_camera=True, set_world=True, specular_from="image")
    made = build_object(result, options)
    lamp = addon.data.objects.new("lamp", addon.data.lights.new("lamp", "SUN"))
    made.scene.collection.objects.link(lamp)
    addon.context.view_layer.objects.active = made.object
    addon.context.view_layer.update()
    assert shows_highlights(made.material)
    return made


def turn(obj: Any) -> None:
    obj.rotation_euler = (0.1, 0.2, 0.3)


def world_value(built: BuiltObject) -> None:
    nodes = built.world.node_tree.nodes
    next(node for node in nodes if node.type == "MAPPING").inputs["Rotation"].default_value[2] = 1


def lens_shifted(built: BuiltObject) -> None:
    assert built.camera is not None
    built.camera.data.shift_x = 0.3


def see_from(built: BuiltObject, name: str) -> None:
    """View > Cameras > Set Active Object as Camera takes any object."""
    obj = bpy.data.objects.get(name) or bpy.data.objects.new(name, None)
    if obj.name not in built.scene.objects:
        built.scene.collection.objects.link(obj)
    built.scene.camera = obj


CHANGES: dict[str, Callable[[BuiltObject], None]] = {
    "lamp turned": lambda built: turn(bpy.data.objects["lamp"]),
    "lamp brighter": lambda built: setattr(bpy.data.lights["lamp"], "energy", 9.0),
    "lamp removed": lambda built: bpy.data.objects.remove(bpy.data.objects["lamp"]),
    "camera moved": lambda built: turn(built.camera),
    "lens": lens_shifted,
    "object turned": lambda built: turn(built.object),
    "seen from an object that is no camera": lambda built: see_from(built, "lamp"),
    "seen from an empty": lambda built: see_from(built, "empty"),
    "sky turned": world_value,
    "sky replaced": lambda built: setattr(built.scene, "world", bpy.data.worlds.new("mine")),
}


@pytest.mark.parametrize("change", CHANGES)
def test_the_layer_is_off_as_soon_as_the_view_changes(
    built: BuiltObject, change: str, capsys: pytest.CaptureFixture[str]
) -> None:
    CHANGES[change](built)
    bpy.context.view_layer.update()
    assert not shows_highlights(built.material)
    assert capsys.readouterr().out.count("photo highlights turned off") == 1
    surface = surface_node(built.material)
    assert surface is not None and surface.inputs["IOR"].default_value > 1.4, "its own are on"


def test_other_changes_keep_the_layer(built: BuiltObject) -> None:
    other = bpy.data.objects.new("cube", bpy.data.meshes.new("cube"))
    built.scene.collection.objects.link(other)
    turn(other)
    built.object.name = "renamed"
    node = dichromatic_node(built.material)
    assert node is not None
    node.inputs["Hue"].default_value = 0.3
    for _ in range(3):
        bpy.context.view_layer.update()
    assert shows_highlights(built.material)


def test_the_layer_is_switched_by_hand_and_remembered_for_the_new_view(
    built: BuiltObject,
) -> None:
    assert bpy.ops.isc.photo_highlights(show=False) == {"FINISHED"}
    assert not shows_highlights(built.material)
    turn(built.object)
    assert bpy.ops.isc.photo_highlights(show=True) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert shows_highlights(built.material)
    turn(bpy.data.objects["lamp"])
    bpy.context.view_layer.update()
    assert not shows_highlights(built.material)


def test_a_new_light_hides_the_layer(built: BuiltObject) -> None:
    assert bpy.ops.isc.relight(light="OPTIMAL") == {"FINISHED"}
    bpy.context.view_layer.update()
    assert not shows_highlights(built.material)


@pytest.mark.parametrize("moved", ["object", "camera", "lamp"])
def test_an_animation_hides_the_layer(built: BuiltObject, moved: str) -> None:
    """At frames at which nothing has moved yet it stays."""
    one = {"object": built.object, "camera": built.camera, "lamp": bpy.data.objects["lamp"]}[moved]
    assert one is not None
    for frame, angle in ((5, 1.0), (4, 0.0), (1, 0.0)):
        one.rotation_mode, one.rotation_euler[2] = "XYZ", angle
        one.keyframe_insert("rotation_euler", index=2, frame=frame)
    built.scene.frame_set(1)
    bpy.ops.isc.photo_highlights(show=True)
    bpy.context.view_layer.update()
    assert shows_highlights(built.material)
    built.scene.frame_set(4)
    assert shows_highlights(built.material)
    built.scene.frame_set(5)
    assert not shows_highlights(built.material)


@pytest.mark.slow
def test_with_the_layer_the_object_looks_as_in_the_photo(
    addon: Any, bump_folder: Path, tmp_path: Path
) -> None:
    """The specular layer takes nothing from the diffuse light while it is replaced."""
    result = replace(read_result(bump_folder), specular_level=1.0, roughness=0.3)
    made = build_object(result, BuildOptions(specular_from="image"))
    addon.context.window.scene = made.scene
    addon.context.view_layer.update()
    seen = render(made.scene, tmp_path, samples=16)["Combined"]
    mask = result.mask & (seen[..., 3] > 0.99)
    assert psnr(result.image, seen[..., :3], mask, peak=float(result.image.max())) > 30


def test_edits_of_scripts_are_baked_without_a_call_of_ours(built: BuiltObject) -> None:
    node, surface = dichromatic_node(built.material), surface_node(built.material)
    assert node is not None and surface is not None
    node.inputs["Value"].default_value = 0.5
    bpy.context.view_layer.update()
    (link,) = surface.inputs["Base Color"].links
    assert link.from_node.type == "TEX_IMAGE"
    values = np.empty(4 * link.from_node.image.size[0] * link.from_node.image.size[1], np.float32)
    link.from_node.image.pixels.foreach_get(values)
    assert values.max() <= 1 and link.from_node.image["isc_role"] == "edited_base_color"


def test_with_a_window_baking_waits_until_the_slider_rests(
    built: BuiltObject, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each move starts the pause again; meanwhile the group is seen."""
    started: list[Any] = []
    rendering = ""
    timers = SimpleNamespace(
        is_registered=lambda timer: timer in started,
        register=lambda timer, first_interval: started.append(timer),
        unregister=started.remove,
    )
    app = SimpleNamespace(
        background=False, timers=timers, is_job_running=lambda kind: kind == rendering
    )
    node, surface = dichromatic_node(built.material), surface_node(built.material)
    assert node is not None and surface is not None
    with monkeypatch.context() as patch:
        patch.setattr(live_edits, "bpy", SimpleNamespace(app=app, data=bpy.data))
        for value in (0.9, 0.8, 0.7):
            node.inputs["Value"].default_value = value
            live_edits.write_edits(built.material)
            (link,) = surface.inputs["Base Color"].links
            assert link.from_node == node and len(started) == 1
        rendering = "RENDER"
        assert started[0]() is not None and link.is_valid, "it waits for a render to end"
        rendering = ""
        assert started[0]() is not None, "a thread computes the colors"
        live_edits._bakes[built.material.session_uid].file.result()
        assert started[0]() is None
    (link,) = surface.inputs["Base Color"].links
    assert link.from_node.type == "TEX_IMAGE"


def test_a_saved_file_has_the_edits(built: BuiltObject, tmp_path: Path) -> None:
    from blender_addon.materials.material_edits import apply_edits

    node, surface = dichromatic_node(built.material), surface_node(built.material)
    assert node is not None and surface is not None
    node.inputs["Value"].default_value = 0.5
    assert apply_edits(built.material)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"), copy=True)
    assert surface.inputs["Base Color"].links[0].from_node.type == "TEX_IMAGE"


def test_a_material_of_an_earlier_version_is_left_as_it_is(addon: Any) -> None:
    """Its group is the whole surface, and its sliders work without us."""
    group = bpy.data.node_groups.new("ISC Dichromatic", "ShaderNodeTree")
    group["isc_group"], group["isc_group_version"] = "ISC Dichromatic", 2
    for name in ("Hue", "Saturation", "Value", "Diffuse Gain", "Specular Gain", "Roughness"):
        group.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Surface", in_out="OUTPUT", socket_type="NodeSocketShader")
    material = bpy.data.materials.new("old")
    material["isc_key"] = "old"
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node, output = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeOutputMaterial")
    node.node_tree = group
    tree.links.new(node.outputs["Surface"], output.inputs["Surface"])
    node.inputs["Hue"].default_value = 0.2
    live_edits.write_edits(material)
    live_edits.prepare_export()
    live_edits.finish_export()
    assert dichromatic_node(material) == node and surface_node(material) is None
    assert len(tree.nodes) == 2 and tree.links[0].from_node == node
