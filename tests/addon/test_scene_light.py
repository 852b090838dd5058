"""World and sun give diffuse surfaces the recovered shading, from the right side."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.files.result_arrays import ResultArrays, read_result
from isc_core.shading.environment_map import directions, shading_under
from tests.addon.scene_render import pixels, render


def build(result: ResultArrays, **options: Any) -> Any:
    from blender_addon.scene import BuildOptions, build_object

    return build_object(result, BuildOptions(**options))


@pytest.fixture
def result(bump_folder: Path) -> ResultArrays:
    return read_result(bump_folder)


def lit(
    built: Any, result: ResultArrays, folder: Path, samples: int = 200
) -> tuple[np.ndarray, np.ndarray]:
    """Direct light on a white surface, and where:

    (N, 3) and (H, W) bool. Shadows are no question: the bump is convex.
    """
    mask = result.mask.copy()
    for _ in range(3):
        mask[1:-1, 1:-1] &= mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    return render(built.scene, folder, samples)["Diffuse Direct"][mask], mask


@pytest.mark.slow
def test_the_world_gives_the_recovered_shading(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    seen, where = lit(build(result), result, tmp_path)
    wanted = result.shading[where] / result.reflectance_scale
    np.testing.assert_allclose(seen, wanted, rtol=0.04)
    np.testing.assert_allclose((seen / wanted).mean(0), 1, atol=0.002)


def apart(seen: np.ndarray, wanted: np.ndarray) -> float:
    """Root mean square of the difference, noise included; light from the wrong side makes it 0.15
    and more.
    """
    return float(np.sqrt(np.square(seen - wanted).mean()))


@pytest.mark.slow
@pytest.mark.parametrize("axis", range(3))
def test_light_keeps_its_direction(
    blender: Any, result: ResultArrays, tmp_path: Path, axis: int
) -> None:
    """An environment map, red in one half of an axis and blue in the other."""
    side = directions(16)[..., axis] > 0
    sky = np.where(side[..., None], [1.0, 0.1, 0.1], [0.1, 0.1, 1.0]).astype(np.float32)
    seen, where = lit(build(replace(result, environment_map=sky)), result, tmp_path, 100)
    assert apart(seen, shading_under(sky, result.normal[where].astype(float))) < 0.02


@pytest.mark.slow
def test_the_stored_rotation_rotates_the_light(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    from blender_addon.scene.world import MAPPING

    side = directions(16)[..., 0] > 0
    sky = np.where(side[..., None], [1.0, 0, 0], [0, 0, 1.0]).astype(np.float32)
    built = build(replace(result, environment_map=sky))
    mapping = built.world.node_tree.nodes[MAPPING]
    assert np.rad2deg(mapping.inputs["Rotation"].default_value[2]) == pytest.approx(
        built.world["isc_rotation"]
    )
    mapping.inputs["Rotation"].default_value[2] += np.pi
    seen, where = lit(built, result, tmp_path, 100)
    turned = shading_under(sky[:, ::-1], result.normal[where].astype(float))
    assert apart(seen, turned) < 0.03


def sunlit(result: ResultArrays) -> ResultArrays:
    direction = np.array([-0.5, 0.4, 0.768], np.float32)
    strength, ambient = np.array([2.0, 1.0, 0.5], np.float32), np.array([0.1, 0.2, 0.3], np.float32)
    return replace(
        result,
        sun_direction=direction / np.linalg.norm(direction),
        sun_strength=strength,
        sun_ambient=ambient,
    )


def expected(result: ResultArrays, where: np.ndarray) -> np.ndarray:
    facing = np.maximum(result.normal[where] @ result.sun_direction, 0)[:, None]
    return result.sun_strength / np.pi * facing + result.sun_ambient


@pytest.mark.slow
def test_sun_and_uniform_light_give_the_shading_of_the_dominant_light(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    sunny = sunlit(result)
    built = build(sunny, sun=True)
    seen, where = lit(built, sunny, tmp_path, 64)
    np.testing.assert_allclose(seen, expected(sunny, where), rtol=0.03)
    build(sunny)
    assert len(blender.data.lights) == 0, "the sun stays where nobody wants it"
    seen, where = lit(built, sunny, tmp_path, 100)
    np.testing.assert_allclose(
        seen.mean(0), (result.shading[where] / result.reflectance_scale).mean(0), rtol=0.02
    )


def test_an_object_is_relit_from_its_properties(blender: Any, result: ResultArrays) -> None:
    from blender_addon.scene.sun import relight
    from blender_addon.scene.world import SUN

    built = build(sunlit(result))
    sun: Any = relight(built.object)
    assert (
        sun.data.type == "SUN"
        and sun.data.energy == pytest.approx(2)
        and sun.name in built.collection.objects
    )
    assert tuple(sun.data.color) == pytest.approx((1, 0.5, 0.25))
    toward = sun.rotation_quaternion.to_matrix().col[2]
    x, y, z = sunlit(result).sun_direction
    assert tuple(toward) == pytest.approx((x, -z, y), abs=1e-6)
    assert built.world.node_tree.nodes[SUN].inputs["Factor"].default_value == 1
    assert relight(built.object, sun=False) is None
    assert (
        built.world.node_tree.nodes[SUN].inputs["Factor"].default_value == 0
        and not blender.data.lights
    )


def test_an_update_keeps_the_rotation_and_strength_of_the_light(
    blender: Any, result: ResultArrays
) -> None:
    nodes = build(result).world.node_tree.nodes
    nodes["ISC Rotation"].inputs["Rotation"].default_value[2] = 0.3
    nodes["ISC Light"].inputs["Strength"].default_value = 2
    brighter = replace(result, environment_map=2 * result.environment_map)
    nodes = build(brighter).world.node_tree.nodes
    assert nodes["ISC Rotation"].inputs["Rotation"].default_value[2] == pytest.approx(0.3)
    assert nodes["ISC Light"].inputs["Strength"].default_value == 2
    texture = next(node for node in nodes if node.type == "TEX_ENVIRONMENT")
    shown = pixels(texture.image)[..., :3]
    np.testing.assert_allclose(shown, brighter.environment_map, rtol=1e-5)
    nodes.remove(nodes["ISC Sun"])
    nodes = build(result).world.node_tree.nodes
    assert "ISC Sun" in nodes and nodes["ISC Light"].inputs["Strength"].default_value == 1


def test_other_objects_cannot_be_relit(blender: Any) -> None:
    from blender_addon.scene.sun import relight
    from isc_core.errors import InputError

    with pytest.raises(InputError, match="not an object of ISC"):
        relight(blender.data.objects.new("cube", None))


def with_lamps(result: ResultArrays, count: int) -> ResultArrays:
    toward = np.array([[0.0, 0.6, 0.8], [0.6, 0.0, 0.8], [-0.6, 0.0, 0.8]], np.float32)[:count]
    return replace(result, lamp_direction=toward, lamp_strength=np.full_like(toward, 2.0))


def lamps() -> list[Any]:
    import bpy

    return [o for o in bpy.data.objects if str(o.get("isc_role", "")).startswith("lamp")]


def test_lamps_of_a_refined_lobe_light_highlights_alone(blender: Any, result: ResultArrays) -> None:
    from mathutils import Vector

    from blender_addon.scene.sun import relight

    built = build(with_lamps(result, 2))
    found = lamps()
    assert len(found) == 2
    assert all(not lamp.visible_diffuse and lamp.data.diffuse_factor == 0 for lamp in found)
    assert all(lamp.data.energy == pytest.approx(2.0) for lamp in found)
    toward = found[0].matrix_basis.to_quaternion() @ Vector((0, 0, 1))
    # The camera frame's y is up, Blender's z.
    assert tuple(toward) == pytest.approx((0.0, -0.8, 0.6), abs=1e-5)
    relight(built.object, True)
    assert all(lamp.hide_render for lamp in lamps()), "the sun lights highlights itself"
    relight(built.object, False)
    assert not any(lamp.hide_render for lamp in lamps())
    build(with_lamps(result, 1))
    assert len(lamps()) == 1, "a lamp that the result no longer has is removed"
    build(result)
    assert not lamps()
    build(with_lamps(result, 2), specular_from="none")
    assert not lamps()


def test_lamps_that_the_user_has_changed_stay(blender: Any, result: ResultArrays) -> None:
    build(with_lamps(result, 3))
    turned, stronger, same = sorted(lamps(), key=lambda lamp: str(lamp["isc_role"]))
    turned.rotation_mode, turned.rotation_euler = "XYZ", (1.0, 0.5, 0.0)
    stronger.data.energy = 7.0
    other = with_lamps(result, 3)
    build(replace(other, lamp_strength=np.full_like(other.lamp_strength, 3.0)))
    assert tuple(turned.rotation_euler) == pytest.approx((1.0, 0.5, 0.0))
    assert [lamp.data.energy for lamp in (turned, stronger, same)] == pytest.approx([2, 7, 3])
    stronger.data.energy, turned.rotation_mode = 2.0, "QUATERNION"
    build(with_lamps(result, 1))
    assert lamps() == [turned], "lamps that the fit no longer has are removed"


@pytest.mark.slow
def test_lamps_leave_the_recovered_shading(
    blender: Any, result: ResultArrays, tmp_path: Path
) -> None:
    seen, where = lit(build(with_lamps(result, 2)), result, tmp_path)
    wanted = result.shading[where] / result.reflectance_scale
    np.testing.assert_allclose((seen / wanted).mean(0), 1, atol=0.002)


def test_without_estimated_sun_an_update_takes_it_out_of_the_scene(
    blender: Any, bump_folder: Path
) -> None:
    result, layer = read_result(bump_folder), blender.context.view_layer
    for sun in (False, True, False, True):
        built = build(result, own_scene=False, sun=sun)
        layer.update()
        assert ("SUN" in [obj.data.type for obj in layer.objects if obj.type == "LIGHT"]) == sun
    built.scene.camera = built.camera
    build(result, own_scene=False)
    assert built.camera.name in layer.objects, "the user looks through it"
