"""The material: one Principled BSDF that renders the recovered light, and documented inputs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.radiance import directional, radiance
from tests.addon.scene_render import pixels, render
from tests.angles import degrees_between

SOCKETS = {
    "Base Color",
    "Diffuse Gain",
    "Hue",
    "Saturation",
    "Value",
    "Specular Level",
    "Specular Gain",
    "Roughness",
    "Gloss Gain",
    "Photo Highlights",
}


def build(result: ResultArrays, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options))


def group_node(built: Any) -> Any:
    from blender_addon.materials.edit_nodes import dichromatic_node

    return dichromatic_node(built.material)


def surface(built: Any) -> Any:
    from blender_addon.materials.edit_nodes import surface_node

    return surface_node(built.material)


def edit(built: Any, **values: float) -> None:
    """Set inputs of the node (`_` for spaces), and write them as a slider does."""
    from blender_addon.materials.material_edits import bake_edits

    for name, value in values.items():
        group_node(built).inputs[name.replace("_", " ")].default_value = value
    bake_edits(built.material)


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
        "Gloss Gain",
    ):
        assert inputs[name].min_value < 0.11 and 1 <= inputs[name].max_value <= 25, name


def test_the_diffuse_color_is_the_base_color_to_8_bits(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    built = build(result)
    paint = render(built.scene, tmp_path)["Diffuse Color"]
    here = inside(result)
    codes, wanted = (255 * linear_to_srgb(one[here]) for one in (paint, result.base_color))
    np.testing.assert_allclose(codes, wanted, atol=0.51)
    assert not built.material.node_tree.nodes.get("ISC Photo Highlights")
    assert {link.from_node.type for link in surface(built).inputs["Base Color"].links} == {
        "TEX_IMAGE"
    }, "exporters read an image on the BSDF, and no group"


def test_images_have_the_right_colour_space_and_are_packed(
    blender: Any, result: ResultArrays
) -> None:
    built = build(replace(result, specular_variation=result.confidence))
    spaces = {image["isc_role"]: image.colorspace_settings.name for image in blender.data.images}
    data = {"normal", "height", "confidence", "mask", "specular_variation"}
    assert {role for role, space in spaces.items() if space == "Non-Color"} == data
    rest = {role: space for role, space in spaces.items() if role not in data}
    assert rest.pop("base_color") == "sRGB" and set(rest.values()) == {"Linear Rec.709"}
    for image in blender.data.images:
        texture = image["isc_role"] in ("base_color", "specular_variation")
        assert image.packed_file and image.is_float != texture
        assert not texture or image.packed_file.data[:4] == b"\x89PNG"
    np.testing.assert_array_equal(pixels(built.object["isc_map_height"])[..., 0], result.height)


def test_recolouring_turns_the_hue(blender: Any, result: ResultArrays, tmp_path: Path) -> None:
    built = build(result)
    here = inside(result)
    edit(built, Hue=0.5 + 1 / 3, Value=0.5)
    turned = render(built.scene, tmp_path)["Diffuse Color"]
    # A third of the circle brings each channel to the next one.
    np.testing.assert_allclose(
        turned[here], 0.5 * np.roll(result.base_color[here], 1, axis=-1), rtol=0.02
    )
    edit(built, Saturation=0)
    grey = render(built.scene, tmp_path)["Diffuse Color"][here]
    assert np.ptp(grey, axis=-1).max() < 1e-6


def lamp(built: Any, direction: np.ndarray) -> None:
    """No light but a point-like sun of irradiance 1."""
    from blender_addon.scene.sun import ensure_sun
    from blender_addon.scene.world import set_sun_mix

    set_sun_mix(built.world, np.zeros(3), True)
    ensure_sun(built.object["isc_key"], built.collection, direction, np.ones(3)).data.angle = 0


def test_the_surface_is_the_diffuse_light_and_a_ggx_lobe(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    """The lobe is that of the fit; of the diffuse light it takes a share that grows sideways."""
    from blender_addon.materials.coated_surface import coated_surface

    direction = np.array([0.3, 0.3, 0.9]) / np.linalg.norm([0.3, 0.3, 0.9])
    built = build(replace(result, specular_level=1.0, roughness=0.45))
    lamp(built, direction)
    here = inside(result)
    layers = render(built.scene, tmp_path, samples=16)
    layer = coated_surface(result).layer(1.0, 0.45)
    assert layer is not None
    under = layer.color_under(result.base_color) * (1 - layer.effect[..., 3:])
    lambert = under[here] / np.pi * np.maximum(result.normal[here] @ direction, 0)[:, None]
    matt = (layers["Diffuse Direct"] * layers["Diffuse Color"])[here]
    np.testing.assert_allclose(matt, lambert, rtol=0.05)
    assert matt.sum() == pytest.approx(lambert.sum(), rel=0.01)
    model = radiance(
        Ggx(0.45**2, 0.04),
        result.normal[here].astype(float),
        np.array([0.0, 0, 1]),
        directional(direction, 1.0),
    )
    bright = model[:, 0] > 0.1 * model.max()
    gloss = (layers["Glossy Direct"] * layers["Glossy Color"])[here]
    np.testing.assert_allclose(gloss[bright], model[bright], rtol=0.06)
    edit(built, Diffuse_Gain=0.5, Specular_Gain=0.5)
    edited = render(built.scene, tmp_path, samples=16)
    half = (edited["Glossy Direct"] * edited["Glossy Color"])[here][bright]
    np.testing.assert_allclose(half, 0.5 * gloss[bright], rtol=0.05)


def test_the_highlight_moves_with_a_lamp(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    """Its centre is where the normal halves the angle between lamp and view."""
    from benchmarks.blender.exported_objects import highlight_centre

    built, view = build(replace(result, specular_level=1.0, roughness=0.25)), np.array([0.0, 0, 1])
    angles = []
    for turn in (0.4, 2.5, 4.6):
        toward = np.array([0.5 * np.cos(turn), 0.5 * np.sin(turn), 0.75**0.5])
        lamp(built, toward)
        layers = render(built.scene, tmp_path, samples=16)
        centre = highlight_centre(layers["Glossy Direct"] * layers["Glossy Color"], result.mask)
        half = (toward + view) / np.linalg.norm(toward + view)
        angles.append(degrees_between(result.normal[centre], half))
    assert max(angles) < 4


@pytest.mark.parametrize(("level", "roughness", "most"), [(0.3, 0.2, 0.03), (1.0, 0.4, 0.06)])
def test_the_object_looks_as_without_a_specular_layer(
    blender: Any, result: ResultArrays, tmp_path: Path, level: float, roughness: float, most: float
) -> None:
    """What the layer mirrors of the recovered light and what it takes from the diffuse one cancel
    in the base colour, pixel by pixel.
    """
    here = inside(result)

    def seen(**options: Any) -> np.ndarray:
        fitted = replace(result, specular_level=level, roughness=roughness)
        layers = render(build(fitted, **options).scene, tmp_path, samples=64)
        return np.asarray(layers["Combined"][here][:, :3])

    plain, layered = seen(specular_from="none", name="a"), seen(name="b")
    assert layered.sum() == pytest.approx(plain.sum(), rel=most / 2)
    assert np.sqrt(np.square(layered / plain - 1).mean()) < most


@pytest.mark.parametrize("sharper", [1, 3])
def test_a_texture_of_any_resolution_is_under_the_layer_as_the_maps_are(
    result: ResultArrays, sharper: int
) -> None:
    from blender_addon.materials.coated_surface import coated_surface

    layer, (rows, columns) = coated_surface(result).layer(1.0, 0.3), result.mask.shape
    assert layer is not None
    codes = np.full((sharper * rows, sharper * columns, 3), (200, 120, 40), np.uint8)
    under = layer.codes_under(codes)
    middle = sharper // 2
    color = srgb_to_linear(np.array([200, 120, 40]) / 255)
    wanted = linear_to_srgb(
        np.clip(layer.color_under(np.broadcast_to(color, (rows, columns, 3))), 0, 1)
    )
    off = under[middle::sharper, middle::sharper] - 255 * wanted
    assert np.abs(off[result.mask]).max() < 0.51
    assert (under[middle::sharper, middle::sharper][result.mask] < codes[0, 0]).all(-1).mean() > 0.5


def test_at_most_half_of_a_color_is_the_mirrored_environment(result: ResultArrays) -> None:
    """Little is taken off as it is, much no further than to the half; in each channel."""
    from isc_core.lobe_fitting.specular_layer import SpecularLayer

    effect = np.zeros((1, 3, 4), np.float32)
    effect[0, :, :3] = np.array([[0.0], [0.01], [10.0]])
    (colors,) = SpecularLayer(effect).color_under(np.full((1, 3, 3), (0.8, 0.4, 0.2)))
    np.testing.assert_allclose(colors[0], (0.8, 0.4, 0.2))
    np.testing.assert_allclose(colors[1], (0.79, 0.39, 0.19), atol=6e-4)
    np.testing.assert_allclose(colors[2], (0.4, 0.2, 0.1))


def test_gloss_and_gains_are_numbers_on_the_surface(blender: Any, result: ResultArrays) -> None:
    from blender_addon.materials.edit_nodes import specular_level

    built = build(replace(result, specular_level=0.8, roughness=0.4))
    inputs = surface(built).inputs

    def numbers() -> list[float]:
        assert not inputs["Roughness"].is_linked and not inputs["IOR"].is_linked
        return [specular_level(surface(built)), inputs["Roughness"].default_value]

    assert numbers() == pytest.approx([0.8, 0.4], rel=0.005)
    edit(built, Specular_Gain=2.0, Gloss_Gain=2.0)
    assert numbers() == pytest.approx([1.6, 0.2], rel=0.005)
    inputs["Roughness"].default_value = 0.7
    edit(built, Hue=0.3)
    assert numbers() == pytest.approx([1.6, 0.7], rel=0.005), "an edit of the BSDF itself is kept"
    edit(built, Gloss_Gain=0.1)
    assert numbers() == pytest.approx([1.6, 1.0], rel=0.005)


def test_an_edited_color_is_an_image_and_an_unedited_one_the_original(
    blender: Any, result: ResultArrays
) -> None:
    from blender_addon.materials.edit_nodes import EDITED
    from blender_addon.materials.material_edits import apply_edits

    built = build(result)
    color = surface(built).inputs["Base Color"]
    original = color.links[0].from_node.image
    group_node(built).inputs["Value"].default_value = 0.5
    assert apply_edits(built.material) and color.links[0].from_node == group_node(built), (
        "while a slider moves, the group is seen"
    )
    edit(built)
    edited = color.links[0].from_node.image
    assert edited != original and edited.packed_file.data[:4] == b"\x89PNG"
    edit(built, Saturation=0)
    assert [image.get("isc_role") for image in blender.data.images].count("edited_base_color") == 1
    edit(built, Saturation=1, Value=1)
    assert color.links[0].from_node.image == original
    assert not built.material.node_tree.nodes.get(EDITED)
    assert "edited_base_color" not in [image.get("isc_role") for image in blender.data.images]


def base_color_image(built: Any) -> Any:
    return surface(built).inputs["Base Color"].links[0].from_node.image


def paint_gray(image: Any) -> None:
    image.pixels.foreach_set(np.tile(np.float32([0.5, 0.5, 0.5, 1]), len(image.pixels) // 4))
    image.update()


def test_paint_on_the_base_color_shows_through_its_edits(
    blender: Any, result: ResultArrays
) -> None:
    built = build(result)
    base = base_color_image(built)
    edit(built, Hue=0.3)
    before = base_color_image(built)
    edit(built)
    assert base_color_image(built) == before, "nothing was painted"
    paint_gray(base)
    edit(built)
    assert base_color_image(built) != base and np.ptp(pixels(base_color_image(built))[..., :3]) == 0
    painted = base_color_image(built).name
    base.pack()
    edit(built)
    assert np.ptp(pixels(base_color_image(built))[..., :3]) == 0, painted


def test_paint_on_an_edited_base_color_stays_in_the_file(
    blender: Any, result: ResultArrays
) -> None:
    built = build(result)
    edit(built, Hue=0.3)
    shown = base_color_image(built)
    paint_gray(shown)
    edit(built, Hue=0.4)
    assert base_color_image(built) != shown
    assert shown.name.endswith("_edited painted") and shown.use_fake_user and not shown.is_dirty
    assert np.ptp(pixels(shown)[..., :3]) == 0 and "isc_role" not in shown
    edit(built, Hue=0.5)
    assert [image for image in blender.data.images if "edited" in image.name] == [shown]


def test_paint_and_duplicates_stay_in_the_file_after_an_update(
    blender: Any, result: ResultArrays
) -> None:
    image = base_color_image(build(result, own_scene=False, all_maps=False))
    name, count = image.name, len(blender.data.images)
    duplicate = image.copy()  # with its tags, as Blender's Duplicate
    duplicate.name, duplicate.use_fake_user = "a first one", True
    image.pixels[:4] = (1.0, 0.0, 1.0, 1.0)
    image.update()
    assert image.is_dirty
    built = build(result, own_scene=False, all_maps=False)
    assert base_color_image(built).name == name and len(blender.data.images) == count + 2
    assert not base_color_image(built).is_dirty and "a first one" in blender.data.images
    painted = blender.data.images[f"{name} painted"]
    assert painted.use_fake_user and painted.packed_file is not None and "isc_key" not in painted
    assert tuple(painted.pixels[:4]) == pytest.approx((1.0, 0.0, 1.0, 1.0), abs=0.01)
    build(result, own_scene=False, all_maps=False)
    assert len(blender.data.images) == count + 2


@pytest.mark.parametrize("varies", [False, True])
def test_the_base_color_follows_the_gloss(blender: Any, result: ResultArrays, varies: bool) -> None:
    """It is that of an object whose fit has the edited gloss; with the fitted gloss again, it is
    what it was.
    """
    from blender_addon.materials.material_edits import apply_edits

    def fitted(level: float, roughness: float, name: str) -> Any:
        variation = 0.5 * result.confidence + 0.25 if varies else None
        found = {"specular_level": level, "roughness": roughness, "specular_variation": variation}
        return build(replace(result, **found), name=name)

    def codes(image: Any) -> np.ndarray:
        return 255 * pixels(image)[..., :3]

    built = fitted(0.8, 0.4, "edited")
    under, plain = base_color_image(built), built.material["isc_plain_base_color"]
    for gain, gloss in ((0.2, 1.0), (3.0, 1.0), (1.0, 0.5), (1.5, 2.0)):
        edit(built, Specular_Gain=gain, Gloss_Gain=gloss)
        wanted = base_color_image(fitted(0.8 * gain, 0.4 / gloss, "wanted"))
        off = np.abs(codes(base_color_image(built)) - codes(wanted))
        assert off.max() < 2.5 and off.mean() < 0.45
        assert np.abs(codes(wanted) - codes(under)).mean() > 1
    shown = base_color_image(built)
    group_node(built).inputs["Gloss Gain"].default_value = 0.7
    assert apply_edits(built.material) and base_color_image(built) == shown, (
        "while the slider moves, the last colour stays"
    )
    edit(built, Specular_Gain=0.0)
    assert base_color_image(built) == plain
    edit(built, Specular_Gain=1.0, Gloss_Gain=1.0)
    assert base_color_image(built) == under
    under.pixels.foreach_set(np.full(4 * under.size[0] * under.size[1], 0.5, np.float32))
    edit(built, Specular_Gain=0.5)
    assert base_color_image(built) == under, "what has been painted on it stays"


@pytest.mark.parametrize(
    ("change", "most"), [({"Specular_Gain": 0.25}, 0.5), ({"Gloss_Gain": 0.5}, 0.9)]
)
def test_an_object_of_less_gloss_looks_as_without(
    blender: Any, result: ResultArrays, tmp_path: Path, change: dict[str, float], most: float
) -> None:
    here, fitted = inside(result), replace(result, specular_level=1.0, roughness=0.4)
    built = build(fitted, name="b")
    under = base_color_image(built)

    def seen(built: Any) -> np.ndarray:
        layers = render(built.scene, tmp_path, samples=64)
        return np.asarray(layers["Combined"][here][:, :3])

    plain = seen(build(fitted, specular_from="none", name="a"))
    edit(built, **change)
    followed = seen(built)
    surface(built).inputs["Base Color"].links[0].from_node.image = under
    left = seen(built)
    error, before = (np.sqrt(np.square(one / plain - 1).mean()) for one in (followed, left))
    assert error < most * before


def test_own_nodes_and_animated_edits_are_left_alone(blender: Any, result: ResultArrays) -> None:
    built = build(result)
    color, tree = surface(built).inputs["Base Color"], built.material.node_tree
    group_node(built).inputs["Hue"].keyframe_insert("default_value", frame=1)
    edit(built, Value=0.5)
    assert color.links[0].from_node == group_node(built), "it follows the keyframes"
    mine = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(mine.outputs["Color"], color)
    edit(built, Value=0.7)
    assert color.links[0].from_node == mine


@pytest.fixture
def mirror(blender: Any) -> Any:
    """A plane, to be seen at an angle under an even sky of radiance 1."""
    from blender_addon.datablocks.nodes import node_tree

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
    material = blender.data.materials.new("white")
    tree = node_tree(material)
    tree.nodes.clear()
    surface, output = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfPrincipled", "OutputMaterial")
    )
    tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])
    surface.inputs["Base Color"].default_value = (1, 1, 1, 1)
    mesh.materials.append(material)
    camera = blender.data.objects.new("camera", blender.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale, scene.camera = "ORTHO", 0.1, camera
    for thing in (camera, blender.data.objects.new("plane", mesh)):
        scene.collection.objects.link(thing)
    return surface.inputs


@pytest.mark.parametrize(("level", "roughness"), [(0.2, 0.2), (1.0, 0.4), (3.0, 0.6)])
def test_the_share_is_that_of_blenders_layers(
    blender: Any, mirror: Any, tmp_path: Path, level: float, roughness: float
) -> None:
    from isc_core.lobe_fitting.specular_layer import specular_share

    mirror["Specular IOR Level"].default_value = 0.5 * level
    mirror["Roughness"].default_value = roughness
    camera = blender.context.scene.camera
    for degrees in (0, 45, 70):
        angle = np.radians(degrees)
        camera.location = 0, -5 * np.sin(angle), 5 * np.cos(angle)
        camera.rotation_euler = angle, 0, 0
        layers = render(blender.context.scene, tmp_path, samples=64)
        taken = 1 - (layers["Diffuse Direct"] * layers["Diffuse Color"]).mean()
        (share,) = specular_share(level, roughness, np.array([np.cos(angle)]))
        assert share == pytest.approx(taken, abs=0.02)
    assert specular_share(0.0, roughness, np.ones(2)).tolist() == [0, 0]


def test_the_fit_sets_level_roughness_and_variation(blender: Any, result: ResultArrays) -> None:
    fitted = replace(
        result, roughness=0.3, specular_level=1.7, specular_variation=result.confidence
    )
    node = group_node(build(fitted))
    assert node.inputs["Roughness"].default_value == pytest.approx(0.3)
    assert node.inputs["Specular Level"].default_value == pytest.approx(1.7)
    (link,) = surface(build(fitted)).inputs["Specular IOR Level"].links
    factor, role = link.from_node, link.from_node.inputs[0].links[0].from_node.image["isc_role"]
    assert role == "specular_variation" and factor.inputs[1].default_value == pytest.approx(0.499)
    built = build(fitted, specular_from="none")
    assert group_node(built).inputs["Specular Level"].default_value == 0
    assert not surface(built).inputs["Specular IOR Level"].is_linked
    assert group_node(build(result)).inputs["Specular Level"].default_value == 0, (
        "gloss that was not fitted"
    )


def test_the_photos_highlights_are_visible_and_emit_no_light(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    from blender_addon.materials.material import set_specular_gain

    built = build(result, specular_from="image")
    set_specular_gain(built.material, 2.0)
    layers, here = render(built.scene, tmp_path), inside(result)
    shine = layers["Emission"] if "Emission" in layers else layers["Emit"]
    np.testing.assert_allclose(shine[here], 2 * result.specular[here], rtol=0.02, atol=2e-4)
    from blender_addon.materials.dichromatic import highlights_group

    strength = next(node for node in highlights_group().nodes if node.type == "EMISSION").inputs[
        "Strength"
    ]
    sources = {link.from_socket.name for link in strength.links[0].from_node.inputs[0].links}
    assert sources == {"Is Camera Ray"}
    assert surface(built).inputs["IOR"].default_value == 1, "not both at once"
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
    assert kept == pytest.approx([0.7, 2.5, 0.2, 1.3, 0.9, 0.9])


def test_keyframes_and_drivers_of_edits_are_kept(blender: Any, result: ResultArrays) -> None:
    built = build(result, own_scene=False)
    inputs, tree = group_node(built).inputs, built.material.node_tree
    for frame, hue in ((1, 0.5), (11, 0.7)):
        inputs["Hue"].default_value = hue
        inputs["Hue"].keyframe_insert("default_value", frame=frame)
    inputs["Value"].driver_add("default_value").driver.expression = "frame / 10"
    build(replace(result, roughness=0.3), specular_from="image", own_scene=False)
    blender.context.scene.frame_set(6)
    values = group_node(built).inputs
    assert values["Hue"].default_value == pytest.approx(0.6), "half way"
    assert values["Value"].default_value == pytest.approx(0.6)
    source = surface(built).inputs["Base Color"].links[0].from_node
    assert source == group_node(built) and len(tree.animation_data.drivers) == 1
    build(result, own_scene=False)
    assert group_node(built).inputs["Photo Highlights"].default_value == 0


def gloss_of(built: Any) -> list[float]:
    return [
        group_node(built).inputs[name].default_value for name in ("Specular Level", "Roughness")
    ]


def test_gloss_is_that_of_the_fit_until_it_is_set_by_hand(
    blender: Any, result: ResultArrays
) -> None:
    first, second = (
        replace(result, specular_level=level, roughness=roughness)
        for level, roughness in ((0.6, 0.4), (1.2, 0.3))
    )
    assert gloss_of(build(first)) == pytest.approx([0.6, 0.4])
    built = build(second)
    assert gloss_of(built) == pytest.approx([1.2, 0.3]), "a new fit"
    group_node(built).inputs["Specular Level"].default_value = 2.0
    assert gloss_of(build(first)) == pytest.approx([2.0, 0.4]), "the level is the user's"
    assert gloss_of(build(first, specular_from="none")) == pytest.approx([0.0, 0.4])
    assert gloss_of(build(first)) == pytest.approx([0.6, 0.4]), "chosen anew"


def test_the_group_is_shared_and_other_versions_are_not_changed(
    blender: Any, result: ResultArrays
) -> None:
    from blender_addon.materials.dichromatic import VERSION

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
        next(
            item
            for item in tree.interface.items_tree
            if item.name == "Roughness" and item.in_out == "INPUT"
        )
    )
    assert group_node(build(result, name="three")).node_tree != tree


def test_a_flat_normal_map_is_left_out(blender: Any, result: ResultArrays) -> None:
    assert not surface(build(result)).inputs["Normal"].is_linked
    tilted = result.normal_map.copy()
    tilted[..., 0] = 0.6
    (link,) = surface(build(replace(result, normal_map=tilted))).inputs["Normal"].links
    assert link.from_node.type == "NORMAL_MAP" and link.from_node.uv_map == "UVMap"
    (link,) = link.from_node.inputs["Color"].links
    assert link.from_node.image.colorspace_settings.name == "Non-Color"
