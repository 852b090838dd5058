"""An import in steps: until the last one the scene is as before, and nothing is left without it."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.datablocks.images import DATA, SRGB, map_file, new_image, unmodified_file  # noqa: E402
from blender_addon.datablocks.staging import run_to_end  # noqa: E402
from blender_addon.files.result_arrays import ResultArrays, read_result  # noqa: E402
from blender_addon.materials.color_bake import ColorEdit, color_source, edited_file  # noqa: E402
from blender_addon.materials.edit_nodes import dichromatic_node, surface_node  # noqa: E402
from blender_addon.operators import live_edits  # noqa: E402
from blender_addon.scene.build import build_object, place_object, stage_object  # noqa: E402
from blender_addon.scene.preparation import BuildOptions, prepare  # noqa: E402
from isc_core.io.png import decode_png  # noqa: E402

SHARED = BuildOptions(own_scene=False)


@pytest.fixture
def result(blender: Any, bump_folder: Path) -> ResultArrays:
    return read_result(bump_folder)


def census() -> dict[str, set[int]]:
    """Every datablock of the file."""
    kinds = ("images", "meshes", "objects", "materials", "collections", "worlds", "node_groups")
    return {kind: {block.session_uid for block in getattr(bpy.data, kind)} for kind in kinds}


@pytest.mark.parametrize("steps", [1, 3, 5])
def test_closed_between_two_steps_it_leaves_nothing(result: ResultArrays, steps: int) -> None:
    before = census()
    running = stage_object(prepare(result, SHARED, with_photo=True), "bump")
    for _ in range(steps):
        next(running)
    assert census() != before
    running.close()
    assert census() == before


def test_what_an_undo_took_away_is_made_again(result: ResultArrays) -> None:
    running = stage_object(prepare(result, SHARED, with_photo=True), "bump")
    next(running)
    bpy.data.images.remove(bpy.data.images[-1])
    staged = run_to_end(running)
    built = place_object(staged)
    textures = [node.image for node in built.material.node_tree.nodes if node.type == "TEX_IMAGE"]
    assert textures and all(image is not None for image in textures)
    assert not [image for image in bpy.data.images if image.users == 0 and "isc_key" not in image]


def test_a_scene_that_refuses_it_stays_as_it_was(result: ResultArrays) -> None:
    from isc_core.errors import InputError

    obj = build_object(result, SHARED).object
    running = stage_object(prepare(result, SHARED, with_photo=True), "bump")
    before = census()
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    staged = run_to_end(running)
    with pytest.raises(InputError, match="return to Object Mode"):
        place_object(staged)
    assert census() == before


def test_the_mesh_of_an_object_is_replaced_with_what_belongs_to_the_user(
    result: ResultArrays,
) -> None:
    obj = build_object(result, SHARED).object
    twin = bpy.data.objects.new("twin", obj.data)
    obj.data["mine"] = 7
    obj.shape_key_add(name="Basis")
    name, materials = obj.data.name, list(obj.data.materials)
    again = build_object(result, BuildOptions(own_scene=False, size_metres=0.2)).object
    assert again == obj and twin.data == obj.data, "copies share it"
    assert (obj.data.name, obj.data["mine"]) == (name, 7)
    assert list(obj.data.materials) == materials
    assert obj.data.shape_keys is None and max(obj.dimensions) > 0.15


def test_the_mesh_is_valid(result: ResultArrays) -> None:
    mesh = build_object(result, BuildOptions(own_scene=False, back="rounded")).object.data
    edges = {tuple(sorted(edge.vertices)) for edge in mesh.edges}
    assert not mesh.validate() and len(edges) == len(mesh.edges)
    assert len(mesh.vertices) - len(mesh.edges) + len(mesh.polygons) == 2, "a closed solid"


@pytest.mark.parametrize("shape", [(37, 50), (37, 50, 3), (16, 5, 4), (1, 1, 3)])
def test_blender_reads_the_maps_as_they_are(blender: Any, shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(1).normal(size=shape).astype(np.float32)
    image = new_image(map_file(values, DATA))
    pixels = np.empty(4 * shape[0] * shape[1], np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(*shape[:2], 4)[::-1]
    channels = shape[2] if len(shape) == 3 else 1
    expected = values if len(shape) == 3 else values[..., None]
    np.testing.assert_array_equal(pixels[..., :channels], expected)
    assert image.is_float and tuple(image.size) == shape[1::-1]


def test_a_painted_image_is_baked_from_its_pixels(result: ResultArrays) -> None:
    image = bpy.data.images[f"{build_object(result, SHARED).object.name}_basecolor"]
    edit, stored = ColorEdit(hue=0.7), unmodified_file(image)
    assert stored and image.colorspace_settings.name == SRGB
    by_file, pixels = edited_file(color_source(image), edit), np.full(4 * 64 * 88, 0.5, np.float32)
    image.pixels.foreach_set(pixels)
    image.update()
    assert not unmodified_file(image)
    by_pixels = edited_file(color_source(image), edit)
    assert by_file is not None and by_pixels is not None
    assert by_pixels.data != by_file.data
    assert np.ptp(decode_png(by_pixels.data)) == 0, "the painted gray has no hue"


def test_a_bake_stops_when_told(result: ResultArrays) -> None:
    image = bpy.data.images[f"{build_object(result, SHARED).object.name}_basecolor"]
    assert edited_file(color_source(image), ColorEdit(hue=0.7), lambda: True) is None


def baked_in_a_window(monkeypatch: pytest.MonkeyPatch, result: ResultArrays) -> Any:
    """The material of an object whose hue was edited a moment ago, its colours being computed."""
    material = build_object(result, SHARED).material
    monkeypatch.setattr(bpy, "app", SimpleNamespace(is_job_running=lambda _: False))
    dichromatic_node(material).inputs["Hue"].default_value = 0.7  # type: ignore[union-attr]
    assert live_edits._bake_when_idle() is not None
    return material


def shown_image(material: Any) -> str:
    source = surface_node(material).inputs["Base Color"].links[0].from_node  # type: ignore[union-attr]
    return "" if source.type != "TEX_IMAGE" else str(source.image.name)


def test_colors_are_baked_in_a_thread(
    monkeypatch: pytest.MonkeyPatch, result: ResultArrays
) -> None:
    material = baked_in_a_window(monkeypatch, result)
    assert shown_image(material) == "", "the group is shown meanwhile"
    live_edits._bakes[material.session_uid].file.result()
    assert live_edits._bake_when_idle() is None
    assert "basecolor_edited" in shown_image(material) and not live_edits._bakes


def test_a_later_edit_ends_an_earlier_bake(
    monkeypatch: pytest.MonkeyPatch, result: ResultArrays
) -> None:
    material = baked_in_a_window(monkeypatch, result)
    first = live_edits._bakes[material.session_uid]
    dichromatic_node(material).inputs["Hue"].default_value = 0.9  # type: ignore[union-attr]
    live_edits._bake_when_idle()
    second = live_edits._bakes[material.session_uid]
    assert first.stop.is_set() and second.state != first.state
    second.file.result()
    live_edits._bake_when_idle()
    assert "basecolor_edited" in shown_image(material)


def test_saving_waits_for_a_bake(monkeypatch: pytest.MonkeyPatch, result: ResultArrays) -> None:
    material = baked_in_a_window(monkeypatch, result)
    live_edits._before_saving()
    assert "basecolor_edited" in shown_image(material) and not live_edits._bakes
