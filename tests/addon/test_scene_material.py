"""The material is the photo taken apart and put together again: paint exact, gloss added, and everything named and explained."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.arrays import Result, read_result
from isc_core.brdf.ggx import Ggx
from isc_core.brdf.shading import directional, radiance
from tests.addon.scene_render import pixels, render

SOCKETS = {
    "Reflectance", "Diffuse Gain", "Hue", "Saturation", "Value", "Specular Image", "Specular Level", "Roughness", "Specular Gain", "Normal",
}  # fmt: skip


def build(result: Result, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions
    from blender_addon.scene import build as build_scene

    return build_scene(result, BuildOptions(**options))


def group_node(built: Any) -> Any:
    from blender_addon.scene.material import dichromatic_node

    return dichromatic_node(built.material)


def inside(result: Result, rings: int = 2) -> np.ndarray:
    """Pixels that the mesh covers for sure, away from the edge between the two paints."""
    mask = result.mask.copy()
    for _ in range(rings):
        mask[1:-1, 1:-1] &= mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    mask[24:31] = False
    return mask


@pytest.fixture
def result(bump_folder: Path) -> Result:
    return read_result(bump_folder)


def test_every_socket_has_a_tooltip_and_a_range(blender: Any, result: Result) -> None:
    tree = group_node(build(result)).node_tree
    inputs = {item.name: item for item in tree.interface.items_tree if item.in_out == "INPUT"}
    assert set(inputs) == SOCKETS and tree.name == "ISC Dichromatic"
    assert all(len(item.description) > 10 for item in inputs.values())
    for name in ("Diffuse Gain", "Specular Gain", "Hue", "Saturation", "Value", "Specular Level", "Roughness"):
        assert inputs[name].min_value == 0 and 1 <= inputs[name].max_value <= 25, name


def test_the_paint_is_the_base_color_to_float32(blender: Any, result: Result, tmp_path: Path) -> None:
    built = build(result)
    paint = render(built.scene, tmp_path)["Diffuse Color"]
    here = inside(result)
    np.testing.assert_allclose(paint[here], result.base_color[here], rtol=2.5e-7)
    assert not built.material.node_tree.nodes.get("ISC Photo Highlights")


def test_images_have_the_right_colour_space_and_are_packed(blender: Any, result: Result) -> None:
    built = build(replace(result, specular_variation=result.confidence))
    spaces = {image["isc_role"]: image.colorspace_settings.name for image in blender.data.images}
    data = {"normal", "height", "confidence", "mask", "specular_variation"}
    assert {role for role, space in spaces.items() if space == "Non-Color"} == data
    assert {space for role, space in spaces.items() if role not in data} == {"Linear Rec.709"}
    assert all(image.packed_file and image.is_float for image in blender.data.images)
    np.testing.assert_array_equal(pixels(built.object["isc_map_height"])[..., 0], result.height)


def test_recolouring_turns_the_hue(blender: Any, result: Result, tmp_path: Path) -> None:
    built = build(result)
    node, here = group_node(built), inside(result)
    node.inputs["Hue"].default_value = 0.5 + 1 / 3
    node.inputs["Value"].default_value = 0.5
    turned = render(built.scene, tmp_path)["Diffuse Color"]
    # A third of the circle brings each channel to the next one.
    np.testing.assert_allclose(turned[here], 0.5 * np.roll(result.base_color[here], 1, axis=-1), rtol=1e-4)
    node.inputs["Saturation"].default_value = 0
    grey = render(built.scene, tmp_path)["Diffuse Color"][here]
    assert np.ptp(grey, axis=-1).max() < 1e-6


def lamp(built: Any, direction: np.ndarray) -> None:
    """No light but a point-like sun of irradiance 1."""
    from blender_addon.scene.sun import ensure_sun
    from blender_addon.scene.world import mix_sun

    mix_sun(built.world, np.zeros(3), True)
    ensure_sun(built.object["isc_key"], built.collection, direction, np.ones(3)).data.angle = 0


def test_gloss_is_added_to_the_paint(blender: Any, result: Result, tmp_path: Path) -> None:
    """Dichromatic: the gloss takes nothing from the paint, and grows with its gain."""
    built = build(result)
    direction = np.array([0.3, 0.3, 0.9]) / np.linalg.norm([0.3, 0.3, 0.9])
    lamp(built, direction)
    node, here = group_node(built), inside(result)
    node.inputs["Roughness"].default_value = 0.45
    matt = render(built.scene, tmp_path)["Combined"][..., :3][here]
    lambert = result.base_color[here] / np.pi * np.maximum(result.normal[here] @ direction, 0)[:, None]
    np.testing.assert_allclose(matt, lambert, rtol=1e-3)
    node.inputs["Specular Level"].default_value = 1
    gloss = render(built.scene, tmp_path)["Combined"][..., :3][here] - matt
    model = radiance(Ggx(0.45**2, 0.04), result.normal[here].astype(float), np.array([0.0, 0, 1]), directional(direction, 1.0))
    bright = model[:, 0] > 0.1 * model.max()
    np.testing.assert_allclose(gloss[bright], model[bright], rtol=0.06)
    node.inputs["Specular Gain"].default_value = 3
    node.inputs["Diffuse Gain"].default_value = 0.5
    edited = render(built.scene, tmp_path)["Combined"][..., :3][here]
    np.testing.assert_allclose(edited, 0.5 * matt + 3 * gloss, rtol=0.002, atol=1e-5)


def test_the_fit_sets_level_roughness_and_variation(blender: Any, result: Result) -> None:
    fitted = replace(result, roughness=0.3, specular_level=1.7, specular_variation=result.confidence)
    node = group_node(build(fitted))
    assert node.inputs["Roughness"].default_value == pytest.approx(0.3)
    assert node.inputs["Specular Level"].default_value == pytest.approx(1.7)
    (link,) = node.inputs["Specular Image"].links
    assert link.from_node.image["isc_role"] == "specular_variation"
    node = group_node(build(fitted, specular_from="none"))
    assert node.inputs["Specular Level"].default_value == 0 and not node.inputs["Specular Image"].is_linked
    assert group_node(build(result)).inputs["Specular Level"].default_value == 0, "gloss that was not fitted"


def test_the_photos_own_highlights_are_seen_and_light_nothing(blender: Any, result: Result, tmp_path: Path) -> None:
    from blender_addon.scene.material import set_specular_gain

    built = build(result, specular_from="image")
    set_specular_gain(built.material, 2.0)
    layers, here = render(built.scene, tmp_path), inside(result)
    shine = layers["Emission"] if "Emission" in layers else layers["Emit"]
    np.testing.assert_allclose(shine[here], 2 * result.specular[here], rtol=0.02, atol=2e-4)
    from blender_addon.scene.dichromatic import highlights_group

    strength = next(node for node in highlights_group().nodes if node.type == "EMISSION").inputs["Strength"]
    sources = {link.from_socket.name for link in strength.links[0].from_node.inputs[0].links}
    assert sources == {"Is Camera Ray"}
    build(result)
    kinds = {node.type for tree in (built.material.node_tree, group_node(built).node_tree) for node in tree.nodes}
    assert "EMISSION" not in kinds and len([n for n in built.material.node_tree.nodes if n.type == "GROUP"]) == 1


def test_what_people_set_stays(blender: Any, result: Result) -> None:
    built = build(result)
    node = group_node(built)
    for name, value in (("Diffuse Gain", 0.7), ("Specular Gain", 2.5), ("Hue", 0.2), ("Saturation", 1.3), ("Value", 0.9)):
        node.inputs[name].default_value = value
    node.inputs["Roughness"].default_value = 0.9
    node = group_node(build(replace(result, roughness=0.3), specular_from="image"))
    kept = [node.inputs[name].default_value for name in ("Diffuse Gain", "Specular Gain", "Hue", "Saturation", "Value", "Roughness")]
    assert kept == pytest.approx([0.7, 2.5, 0.2, 1.3, 0.9, 0.3])


def test_the_group_is_shared_and_another_versions_is_left_alone(blender: Any, result: Result) -> None:
    first, second = build(result, name="one"), build(result, name="two")
    assert group_node(first).node_tree == group_node(second).node_tree
    old = group_node(first).node_tree
    old["isc_group_version"] = 0
    third = build(result, name="three")
    assert group_node(third).node_tree != old and group_node(second).node_tree == old
    assert group_node(third).node_tree["isc_group_version"] == 1


def test_an_edited_group_is_kept_and_a_broken_one_replaced(blender: Any, result: Result) -> None:
    tree = group_node(build(result)).node_tree
    tree.nodes.new("ShaderNodeMath").name = "mine"
    assert "mine" in group_node(build(result, name="two")).node_tree.nodes
    tree.interface.remove(next(item for item in tree.interface.items_tree if item.name == "Roughness"))
    assert group_node(build(result, name="three")).node_tree != tree


def test_the_normal_map_is_used_where_it_says_something(blender: Any, result: Result) -> None:
    node = group_node(build(result))
    assert not node.inputs["Normal"].is_linked
    tilted = result.normal_map.copy()
    tilted[..., 0] = 0.6
    node = group_node(build(replace(result, normal_map=tilted)))
    (link,) = node.inputs["Normal"].links
    assert link.from_node.type == "NORMAL_MAP" and link.from_node.uv_map == "UVMap"
    (link,) = link.from_node.inputs["Color"].links
    assert link.from_node.image.colorspace_settings.name == "Non-Color"
