"""The material: exact reflectance, an added specular lobe, and documented inputs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.radiance import directional, radiance
from tests.addon.scene_render import pixels, render

SOCKETS = {
    "Reflectance",
    "Diffuse Gain",
    "Hue",
    "Saturation",
    "Value",
    "Specular Image",
    "Specular Level",
    "Roughness",
    "Specular Gain",
    "Normal",
}


def build(result: ResultArrays, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options))


def group_node(built: Any) -> Any:
    from blender_addon.scene.material import dichromatic_node

    return dichromatic_node(built.material)


def inside(result: ResultArrays, rings: int = 2) -> np.ndarray:
    """Pixels that the mesh covers for sure, away from the edge between the two reflectances."""
    mask = result.mask.copy()
    for _ in range(rings):
        mask[1:-1, 1:-1] &= mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    mask[24:31] = False
    return mask


@pytest.fixture
def result(bump_folder: Path) -> ResultArrays:
    return read_result(bump_folder)


def test_every_socket_has_a_tooltip_and_a_range(blender: Any, result: ResultArrays) -> None:
    tree = group_node(build(result)).node_tree
    inputs = {item.name: item for item in tree.interface.items_tree if item.in_out == "INPUT"}
    assert set(inputs) == SOCKETS and tree.name == "ISC Dichromatic"
    assert all(len(item.description) > 10 for item in inputs.values())
    for name in (
        "Diffuse Gain",
        "Specular Gain",
        "Hue",
        "Saturation",
        "Value",
        "Specular Level",
        "Roughness",
    ):
        assert inputs[name].min_value == 0 and 1 <= inputs[name].max_value <= 25, name


def test_the_diffuse_color_is_the_base_color_to_float32(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    built = build(result)
    paint = render(built.scene, tmp_path)["Diffuse Color"]
    here = inside(result)
    np.testing.assert_allclose(paint[here], result.base_color[here], rtol=2.5e-7)
    assert not built.material.node_tree.nodes.get("ISC Photo Highlights")


def test_images_have_the_right_colour_space_and_are_packed(
    blender: Any, result: ResultArrays
) -> None:
    built = build(replace(result, specular_variation=result.confidence))
    spaces = {image["isc_role"]: image.colorspace_settings.name for image in blender.data.images}
    data = {"normal", "height", "confidence", "mask", "specular_variation"}
    assert {role for role, space in spaces.items() if space == "Non-Color"} == data
    assert {space for role, space in spaces.items() if role not in data} == {"Linear Rec.709"}
    assert all(image.packed_file and image.is_float for image in blender.data.images)
    np.testing.assert_array_equal(pixels(built.object["isc_map_height"])[..., 0], result.height)


def test_recolouring_turns_the_hue(blender: Any, result: ResultArrays, tmp_path: Path) -> None:
    built = build(result)
    node, here = group_node(built), inside(result)
    node.inputs["Hue"].default_value = 0.5 + 1 / 3
    node.inputs["Value"].default_value = 0.5
    turned = render(built.scene, tmp_path)["Diffuse Color"]
    # A third of the circle brings each channel to the next one.
    np.testing.assert_allclose(
        turned[here], 0.5 * np.roll(result.base_color[here], 1, axis=-1), rtol=1e-4
    )
    node.inputs["Saturation"].default_value = 0
    grey = render(built.scene, tmp_path)["Diffuse Color"][here]
    assert np.ptp(grey, axis=-1).max() < 1e-6


def lamp(built: Any, direction: np.ndarray) -> None:
    """No light but a point-like sun of irradiance 1."""
    from blender_addon.scene.sun import ensure_sun
    from blender_addon.scene.world import set_sun_mix

    set_sun_mix(built.world, np.zeros(3), True)
    ensure_sun(built.object["isc_key"], built.collection, direction, np.ones(3)).data.angle = 0


def test_the_specular_lobe_is_added_to_the_diffuse(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    """The specular lobe does not attenuate the diffuse one, and scales with its gain."""
    built = build(result)
    direction = np.array([0.3, 0.3, 0.9]) / np.linalg.norm([0.3, 0.3, 0.9])
    lamp(built, direction)
    node, here = group_node(built), inside(result)
    node.inputs["Roughness"].default_value = 0.45
    matt = render(built.scene, tmp_path)["Combined"][..., :3][here]
    lambert = (
        result.base_color[here] / np.pi * np.maximum(result.normal[here] @ direction, 0)[:, None]
    )
    np.testing.assert_allclose(matt, lambert, rtol=1e-3)
    node.inputs["Specular Level"].default_value = 1
    gloss = render(built.scene, tmp_path)["Combined"][..., :3][here] - matt
    model = radiance(
        Ggx(0.45**2, 0.04),
        result.normal[here].astype(float),
        np.array([0.0, 0, 1]),
        directional(direction, 1.0),
    )
    bright = model[:, 0] > 0.1 * model.max()
    np.testing.assert_allclose(gloss[bright], model[bright], rtol=0.06)
    node.inputs["Specular Gain"].default_value = 3
    node.inputs["Diffuse Gain"].default_value = 0.5
    edited = render(built.scene, tmp_path)["Combined"][..., :3][here]
    np.testing.assert_allclose(edited, 0.5 * matt + 3 * gloss, rtol=0.002, atol=1e-5)


@pytest.fixture
def mirror(blender: Any) -> Any:
    """A plane of black paint, to be seen at an angle under an even sky of radiance 1: what is seen
    is the share that it mirrors.
    """
    from blender_addon.scene.dichromatic import dichromatic_group
    from blender_addon.scene.nodes import node_tree

    scene, world = blender.context.scene, blender.data.worlds.new("even")
    scene.world, scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = (
        world,
        "CYCLES",
        4,
        4,
    )
    next(node for node in node_tree(world).nodes if node.type == "BACKGROUND").inputs[
        "Color"
    ].default_value = (1, 1, 1, 1)
    mesh = blender.data.meshes.new("plane")
    mesh.from_pydata([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [], [(0, 1, 2, 3)])
    material = blender.data.materials.new("black")
    tree = node_tree(material)
    tree.nodes.clear()
    group, output = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeOutputMaterial")
    group.node_tree = dichromatic_group()
    tree.links.new(group.outputs["Surface"], output.inputs["Surface"])
    group.inputs["Reflectance"].default_value, group.inputs["Roughness"].default_value = (
        (0, 0, 0, 1),
        0,
    )
    mesh.materials.append(material)
    camera = blender.data.objects.new("camera", blender.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale, scene.camera = "ORTHO", 0.1, camera
    for thing in (camera, blender.data.objects.new("plane", mesh)):
        scene.collection.objects.link(thing)
    return group.inputs


def mirrored(blender: Any, folder: Path, degrees: float) -> np.ndarray:
    """The share (3,) that the plane mirrors toward a viewer so many degrees off its normal."""
    angle = np.radians(degrees)
    camera = blender.context.scene.camera
    camera.location, camera.rotation_euler = (
        (0, -5 * np.sin(angle), 5 * np.cos(angle)),
        (angle, 0, 0),
    )
    seen: np.ndarray = render(blender.context.scene, folder, samples=4)["Combined"][..., :3].mean(
        (0, 1)
    )
    return seen


def fresnel(degrees: float, f0: float = 0.04) -> float:
    """Fresnel reflectance of a dielectric of that f0 for unpolarised light."""
    index = (1 + f0**0.5) / (1 - f0**0.5)
    cosine = np.cos(np.radians(degrees))
    inner = np.sqrt(1 - np.sin(np.radians(degrees)) ** 2 / index**2)
    across, along = (
        (cosine - index * inner) / (cosine + index * inner),
        (inner - index * cosine) / (inner + index * cosine),
    )
    return float((across**2 + along**2) / 2)


@pytest.mark.parametrize("degrees", [0, 60, 85])
def test_the_level_scales_the_whole_lobe_at_grazing_angles_too(
    blender: Any, mirror: Any, tmp_path: Path, degrees: float
) -> None:
    """As in the fit: a weak lobe with bright grazing angles would veil the object."""
    plastic = fresnel(degrees)
    for level, gain in ((0.0, 1.0), (0.38, 1.0), (0.8, 0.25), (1.0, 1.0)):
        mirror["Specular Level"].default_value, mirror["Specular Gain"].default_value = level, gain
        np.testing.assert_allclose(
            mirrored(blender, tmp_path, degrees), level * gain * plastic, rtol=0.01, atol=1e-5
        )


def test_a_level_above_plastic_reflects_at_most_all_light(
    blender: Any, mirror: Any, tmp_path: Path
) -> None:
    mirror["Specular Level"].default_value = 3.0
    np.testing.assert_allclose(mirrored(blender, tmp_path, 0), 0.12, rtol=0.01)
    steep = mirrored(blender, tmp_path, 85)
    assert (fresnel(85) < steep).all() and (steep < 1).all()


def test_a_specular_image_is_a_factor_of_the_level(
    blender: Any, mirror: Any, tmp_path: Path
) -> None:
    """A grey image scales the lobe; a coloured one tints the reflection along the normal."""
    mirror["Specular Level"].default_value = 0.8
    mirror["Specular Image"].default_value = (0.5, 0.5, 0.5, 1)
    np.testing.assert_allclose(mirrored(blender, tmp_path, 85), 0.4 * fresnel(85), rtol=0.01)
    mirror["Specular Image"].default_value = (0.9, 0.5, 0.1, 1)
    np.testing.assert_allclose(
        mirrored(blender, tmp_path, 0), 0.04 * 0.8 * np.array([0.9, 0.5, 0.1]), rtol=0.01
    )
    mirror["Specular Image"].default_value = (0, 0, 0, 1)
    assert mirrored(blender, tmp_path, 85).max() == 0


def test_the_fit_sets_level_roughness_and_variation(blender: Any, result: ResultArrays) -> None:
    fitted = replace(
        result, roughness=0.3, specular_level=1.7, specular_variation=result.confidence
    )
    node = group_node(build(fitted))
    assert node.inputs["Roughness"].default_value == pytest.approx(0.3)
    assert node.inputs["Specular Level"].default_value == pytest.approx(1.7)
    (link,) = node.inputs["Specular Image"].links
    assert link.from_node.image["isc_role"] == "specular_variation"
    node = group_node(build(fitted, specular_from="none"))
    assert (
        node.inputs["Specular Level"].default_value == 0
        and not node.inputs["Specular Image"].is_linked
    )
    assert group_node(build(result)).inputs["Specular Level"].default_value == 0, (
        "gloss that was not fitted"
    )


def test_the_photos_highlights_are_visible_and_emit_no_light(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    from blender_addon.scene.material import set_specular_gain

    built = build(result, specular_from="image")
    set_specular_gain(built.material, 2.0)
    layers, here = render(built.scene, tmp_path), inside(result)
    shine = layers["Emission"] if "Emission" in layers else layers["Emit"]
    np.testing.assert_allclose(shine[here], 2 * result.specular[here], rtol=0.02, atol=2e-4)
    from blender_addon.scene.dichromatic import highlights_group

    strength = next(node for node in highlights_group().nodes if node.type == "EMISSION").inputs[
        "Strength"
    ]
    sources = {link.from_socket.name for link in strength.links[0].from_node.inputs[0].links}
    assert sources == {"Is Camera Ray"}
    build(result)
    kinds = {
        node.type
        for tree in (built.material.node_tree, group_node(built).node_tree)
        for node in tree.nodes
    }
    assert (
        "EMISSION" not in kinds
        and len([n for n in built.material.node_tree.nodes if n.type == "GROUP"]) == 1
    )


def test_edited_values_are_kept(blender: Any, result: ResultArrays) -> None:
    built = build(result)
    node = group_node(built)
    for name, value in (
        ("Diffuse Gain", 0.7),
        ("Specular Gain", 2.5),
        ("Hue", 0.2),
        ("Saturation", 1.3),
        ("Value", 0.9),
    ):
        node.inputs[name].default_value = value
    node.inputs["Roughness"].default_value = 0.9
    node = group_node(build(replace(result, roughness=0.3), specular_from="image"))
    kept = [
        node.inputs[name].default_value
        for name in ("Diffuse Gain", "Specular Gain", "Hue", "Saturation", "Value", "Roughness")
    ]
    assert kept == pytest.approx([0.7, 2.5, 0.2, 1.3, 0.9, 0.3])


def test_the_group_is_shared_and_other_versions_are_not_changed(
    blender: Any, result: ResultArrays
) -> None:
    from blender_addon.scene.dichromatic import VERSION

    first, second = build(result, name="one"), build(result, name="two")
    assert group_node(first).node_tree == group_node(second).node_tree
    old = group_node(first).node_tree
    old["isc_group_version"] = 0
    third = build(result, name="three")
    assert group_node(third).node_tree != old and group_node(second).node_tree == old
    assert group_node(third).node_tree["isc_group_version"] == VERSION
    group_node(second).inputs["Hue"].default_value = 0.2
    second = build(result, name="two")
    assert group_node(second).node_tree == group_node(third).node_tree, (
        "built again, an object has this version's group"
    )
    assert group_node(second).inputs["Hue"].default_value == pytest.approx(0.2)


def test_an_edited_group_is_kept_and_a_broken_one_replaced(
    blender: Any, result: ResultArrays
) -> None:
    tree = group_node(build(result)).node_tree
    tree.nodes.new("ShaderNodeMath").name = "mine"
    assert "mine" in group_node(build(result, name="two")).node_tree.nodes
    tree.interface.remove(
        next(item for item in tree.interface.items_tree if item.name == "Roughness")
    )
    assert group_node(build(result, name="three")).node_tree != tree


def test_a_flat_normal_map_is_left_out(blender: Any, result: ResultArrays) -> None:
    node = group_node(build(result))
    assert not node.inputs["Normal"].is_linked
    tilted = result.normal_map.copy()
    tilted[..., 0] = 0.6
    node = group_node(build(replace(result, normal_map=tilted)))
    (link,) = node.inputs["Normal"].links
    assert link.from_node.type == "NORMAL_MAP" and link.from_node.uv_map == "UVMap"
    (link,) = link.from_node.inputs["Color"].links
    assert link.from_node.image.colorspace_settings.name == "Non-Color"


@pytest.mark.parametrize(("size", "longer"), [(0, 352), (176, 176), (64, 88)])
def test_the_base_colour_has_the_texture_size(
    blender: Any, bump_folder: Path, size: int, longer: int
) -> None:
    """A photo of four times the maps' size (88 x 64)."""
    from blender_addon.scene import BuildOptions, build_object

    result = read_result(bump_folder)
    codes = np.full((256, 352, 3), 188, np.uint8)  # half of the light
    build_object(
        replace(result, photo_base_color=codes), BuildOptions(texture_size=size, back="rounded")
    )
    image = next(i for i in blender.data.images if i.get("isc_role") == "base_color")
    assert max(image.size) == longer
    if longer > 88:
        assert image.pixels[0] == pytest.approx(0.5, abs=0.01)
