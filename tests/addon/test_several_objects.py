"""Each object of a photo becomes one of Blender: a photo of rendered objects, and its scene."""

import contextlib
import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.datablocks.staging import run_to_end  # noqa: E402
from blender_addon.files.result_arrays import read_result  # noqa: E402
from blender_addon.operators import decompose as operators  # noqa: E402
from blender_addon.operators import result  # noqa: E402
from blender_addon.operators.modal import advance_run  # noqa: E402
from blender_addon.runs.active_run import begin_run  # noqa: E402
from blender_addon.runs.request import DecomposeRequest, request_from_settings  # noqa: E402
from blender_addon.runs.worker_run import RunOutput  # noqa: E402
from blender_addon.scene.built_object import find_built  # noqa: E402
from blender_addon.scene.objects import place_objects, prepare_objects, stage_objects  # noqa: E402
from blender_addon.scene.preparation import BuildOptions  # noqa: E402
from blender_addon.scene.world import sun_mix  # noqa: E402
from isc_core.result_files.object_folders import object_folders  # noqa: E402
from isc_core.result_files.result_folder import save  # noqa: E402
from tests.addon.scene_fixture import bump, write_result  # noqa: E402
from tests.addon.scene_render import render  # noqa: E402
from tests.addon.test_operators import census  # noqa: E402
from tests.addon.test_operators_run import until  # noqa: E402
from tests.addon.test_scene_perspective import evaluated_vertices, seen_pixels  # noqa: E402
from tests.core import perspective_scene  # noqa: E402

SIZE = (120, 64)
PLACES = ((-1.9, 0.1, 0.7), (0.2, -0.2, 0.95), (2.2, 0.35, 0.5))  # x, z, radius


@pytest.fixture(scope="module")
def shelf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo of three balls of one paint each under one lamp, rendered before nothing."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for (x, z, radius), color in zip(
        PLACES, ((0.6, 0.1, 0.08), (0.12, 0.3, 0.5), (0.5, 0.45, 0.1)), strict=True
    ):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, location=(x, 0, z))
        ball = bpy.context.object
        ball.scale = (radius, radius, radius)
        for face in ball.data.polygons:
            face.use_smooth = True
        material = bpy.data.materials.new("paint")
        material.use_nodes = True
        shader = material.node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (*color, 1)
        shader.inputs["Roughness"].default_value = 0.35
        ball.data.materials.append(material)
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "SUN"))
    lamp.data.energy, lamp.rotation_euler = 2.5, (0.9, -0.4, 0)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 6.0
    camera.location, camera.rotation_euler = (0, -8, 0), (np.pi / 2, 0, 0)
    for one in (lamp, camera):
        scene.collection.objects.link(one)
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.3, 0.3, 0.3, 1)
    scene.camera, scene.render.film_transparent = camera, True
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    folder = tmp_path_factory.mktemp("shelf")
    combined = render(scene, folder, samples=16)["Combined"]
    codes = np.where(
        combined[..., :3] <= 0.0031308,
        12.92 * combined[..., :3],
        1.055 * np.maximum(combined[..., :3], 1e-6) ** (1 / 2.4) - 0.055,
    )
    pixels = np.dstack([codes[..., ::-1], combined[..., 3] > 0.5])
    cv2.imwrite(str(folder / "shelf.png"), np.rint(65535 * np.clip(pixels, 0, 1)).astype("uint16"))
    return folder / "shelf.png"


def use(addon: Any, path: Path, **options: Any) -> Any:
    settings = addon.context.scene.isc
    settings.image = addon.data.images.load(str(path), check_existing=True)
    for name, value in {"each": True, "max_size": 48, "model": "mdr", **options}.items():
        setattr(settings, name, value)
    return settings


def looks(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Linear colors and mask of the photo."""
    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., [2, 1, 0, 3]].astype(float) / 65535
    coded = pixels[..., :3]
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    return linear, pixels[..., 3] > 0.5


@pytest.mark.slow
def test_the_scene_looks_like_the_photo(addon: Any, shelf: Path, tmp_path: Path) -> None:
    use(addon, shelf, own_scene=True, back="rounded")
    assert addon.ops.isc.decompose() == {"FINISHED"}
    shown = addon.context.window_manager.isc
    assert shown.message == "3 objects created in the scene shelf", shown.message
    scene = addon.context.scene
    made = [addon.data.objects[f"shelf {number}"] for number in (1, 2, 3)]
    assert all(one.users_scene == (scene,) and one.select_get() for one in made)
    assert addon.context.object == made[1], "the largest one, whose light shines"
    assert len([one for one in scene.objects if one.type == "CAMERA"]) == 1
    photo, mask = looks(shelf)
    assert scene.render.resolution_x == SIZE[0]
    picture = render(scene, tmp_path, samples=32)["Combined"]
    seen = picture[..., 3] > 0.5
    assert (seen & mask).sum() / (seen | mask).sum() > 0.9
    for x, z, radius in PLACES:
        column, row = (SIZE[0] * (0.5 + x / 6), 0.5 * SIZE[1] - z * SIZE[0] / 6)
        down, across = np.indices(mask.shape) + 0.5
        reach = 0.7 * radius * SIZE[0] / 6
        inner = (across - column) ** 2 + (down - row) ** 2 < reach**2
        given, got = (np.median(one[inner], axis=0) for one in (photo, picture[..., :3]))
        np.testing.assert_allclose(got, given, rtol=0.2, atol=0.02)


@pytest.mark.slow
def test_all_come_in_one_undo_step_and_update_changes_them(
    addon: Any, shelf: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The operator that has the undo step is called once; Blender undoes in windows only."""
    use(addon, shelf, own_scene=False, max_size=24, model="naive")
    placed = []

    def place(staged: list[Any], **given: Any) -> Any:
        placed.append(len(staged))
        return place_objects(staged, **given)

    monkeypatch.setattr(result, "place_objects", place)
    assert "UNDO" in result.ISC_OT_build_result.bl_options
    assert addon.ops.isc.decompose() == {"FINISHED"}
    assert addon.context.window_manager.isc.message == "3 objects created at the 3D cursor"
    one = addon.data.objects["shelf 2"]
    one.location.x += 1
    moved, vertices = one.location.copy(), len(one.data.vertices)
    assert addon.ops.isc.redo(max_size=48) == {"FINISHED"}
    assert addon.context.window_manager.isc.message == "3 objects updated"
    one = addon.data.objects["shelf 2"]
    assert one.location == moved and len(one.data.vertices) > vertices
    stored = json.loads(one["isc_request"])["build"]
    assert stored["name"] == "shelf" and stored["each"]
    assert placed == [3, 3] and len([o for o in addon.data.objects if o.type == "MESH"]) == 3


@pytest.mark.slow
def test_cancel_leaves_nothing_half_made(addon: Any, shelf: Path) -> None:
    """At any step of the import, when some objects are made and others are not."""
    use(addon, shelf, own_scene=False, max_size=32, model="naive")
    before = census(addon)
    request = request_from_settings(addon.context.scene)
    for steps in (0, 1, 8, 16):
        run = begin_run(operators.create_decompose_run(addon.context, request))
        while run.step().state == "running":
            pass
        assert run.status.state == "ready", run.status.message
        importing = run._finish(addon.context, run._output)
        for _ in range(steps):
            next(importing)
        importing.close()
        run.cancel()
        assert census(addon) == before and not run.folder.exists()


def started(addon: Any, shelf: Path, size: int, model: str = "mdr") -> Any:
    use(addon, shelf, own_scene=False, max_size=size, model=model)
    request = request_from_settings(addon.context.scene)
    return begin_run(operators.create_decompose_run(addon.context, request))


@pytest.mark.slow
def test_progress_and_time_left_are_those_of_all_objects(addon: Any, shelf: Path) -> None:
    """Whatever the machine's speed; `test_pace` has the values for known times."""
    run, seen = started(addon, shelf, 26), []
    while run.step().state == "running":
        seen.append(run.status)
        time.sleep(0.02)
    run.cancel()
    shares = [status.fraction for status in seen]
    assert shares == sorted(shares) and shares[-1] == 1
    stages = [one.stage for one in seen]
    for number in (1, 2, 3):
        assert any(stage.startswith(f"object {number} of 3: ") for stage in stages)
    lefts = [one.seconds_left for one in seen if one.stage.startswith("object ")]
    told = [left is not None for left in lefts]
    assert told == sorted(told), "an estimate, once given, stays"


@pytest.mark.slow
@pytest.mark.parametrize("when", ["finding the objects", "object 1", "between", "object 3"])
def test_cancel_keeps_nothing_of_what_was_done(addon: Any, shelf: Path, when: str) -> None:
    """In an object, between two, and before the first: the worker ends, scene and disk are as
    before, and a later run makes all of them.
    """
    use(addon, shelf)
    before, there = census(addon), workers()
    run = started(addon, shelf, 27)

    def is_now() -> bool:
        first = run.folder / "result" / "1" / "decomposition.json"
        return first.is_file() if when == "between" else run.status.stage.startswith(when)

    until(lambda: run.step().state != "running" or is_now(), 100)
    assert run.status.state == "running" and workers() > there
    run.cancel()
    assert run.status.state == "cancelled"
    until(lambda: workers() == there and not run.folder.exists())
    assert census(addon) == before
    again = started(addon, shelf, 27)
    until(lambda: again.step().state != "running" or "object 1" in again.status.stage, 100)
    assert again.status.state == "running", "nothing was kept for it"
    again.cancel()
    until(lambda: workers() == there)


@pytest.mark.slow
def test_an_object_that_fails_leaves_the_others(addon: Any, shelf: Path) -> None:
    run = started(addon, shelf, 25, model="naive")
    (run.folder / "result" / "2").mkdir(parents=True)
    (run.folder / "result" / "2" / "diary.txt").write_text("mine")
    while not advance_run(addon.context, run):
        time.sleep(0.02)
    assert run.status.message == "2 objects created at the 3D cursor"
    assert run.status.notes[0].startswith("note: object 2 of 3: ")
    assert run.status.notes[0].endswith("1 of 3 objects failed")
    assert {one.name for one in addon.data.objects if one.type == "MESH"} == {"shelf 1", "shelf 3"}
    assert addon.ops.isc.decompose() == {"FINISHED"}
    assert addon.data.objects["shelf 2"].type == "MESH", "the next run tries it again"


def workers() -> set[int]:
    """Processes that this one has started and that go on."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = path.read_text().rpartition(")")[2].split()
            if int(fields[1]) == os.getpid() and fields[0] != "Z":
                found.add(int(path.parent.name))
    return found


@pytest.mark.slow
def test_highlights_that_are_marked_belong_to_one_object(addon: Any, shelf: Path) -> None:
    use(addon, shelf, model="joint", highlights="60,32")
    run = begin_run(
        operators.create_decompose_run(addon.context, request_from_settings(addon.context.scene))
    )
    while not advance_run(addon.context, run):
        pass
    assert run.status.state == "failed" and "Each Object" in run.status.message
    assert "--" not in run.status.message


def several_results(folder: Path) -> list[Any]:
    """The bump, and a smaller one beside it in the same photo, under a light half as strong."""
    left, right = bump(64, 200, (27.0, 38.0)), bump(64, 200, (35.0, 150.0))
    right.reflectance[:] *= 2
    right.shading[:] /= 2
    right.illumination[0] -= np.log(2) * 2 * np.sqrt(np.pi)
    write_result(folder / "1", left)
    write_result(folder / "2", right)
    return [read_result(one) for one in object_folders(folder)]


def test_objects_lie_as_in_the_photo_under_one_light(blender: Any, tmp_path: Path) -> None:
    results = several_results(tmp_path)
    options = BuildOptions(size_metres=0.5, name="pair", each=True, own_scene=False)
    prepared = prepare_objects(results, options)
    assert [one.options.name for one in prepared] == ["pair 1", "pair 2"]
    first, second = (one.result for one in prepared)
    inside = second.mask
    np.testing.assert_allclose(
        second.base_color[inside].mean() / first.base_color[first.mask].mean(), 1, rtol=0.05
    )
    np.testing.assert_allclose(second.mesh_illumination, first.mesh_illumination, atol=0.05)
    assert max(one.base_color.max() for one in (first, second)) <= max(
        one.base_color.max() for one in results
    )
    left, right = (one.object for one in place_objects(run_to_end(stage_objects(prepared))))
    step = 0.5 / results[0].longest_side
    offset = right.location - left.location
    expected = (results[1].origin - results[0].origin)[:2] * step
    np.testing.assert_allclose(offset, (expected[0], 0, -expected[1]), atol=1e-6)
    cameras = [built.camera for one in (left, right) if (built := find_built(one)) is not None]
    assert cameras[0] is not None and cameras[1:] == [None], "one camera, of the photo"


def test_one_pinhole_camera_sees_each_object_where_the_photo_does(
    blender: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder, centre in (("1", (34.0, 24.0)), ("2", (24.0, 58.0))):
        monkeypatch.setattr(perspective_scene, "CENTRE", centre)
        save(perspective_scene.bump_before_camera(), tmp_path / folder, arrays=True)
    results = [read_result(one) for one in object_folders(tmp_path)]
    prepared = prepare_objects(results, BuildOptions(name="pair", each=True))
    built = place_objects(run_to_end(stage_objects(prepared)))
    assert abs(built[1].object.location.y) < 1e-3, "in one plane across the view"
    for one, seen in zip(built, results, strict=True):
        off = seen_pixels(replace(one, camera=built[0].camera), evaluated_vertices(one))
        assert np.abs(off - seen.vertex_pixel).max() < 0.01
    options = BuildOptions(name="solids", each=True, back="flat", size_metres=0.5)
    solids = place_objects(run_to_end(stage_objects(prepare_objects(results, options))))
    corners = [evaluated_vertices(one) for one in solids]
    assert max(np.ptp(one, axis=0)[[0, 2]].max() for one in corners) == pytest.approx(0.5, rel=1e-4)
    for solid, points, first in zip(solids, corners, built, strict=True):
        pixels, before = (
            seen_pixels(replace(one, camera=camera), vertices)
            for one, camera, vertices in (
                (solid, solids[0].camera, points),
                (first, built[0].camera, evaluated_vertices(first)),
            )
        )
        assert np.abs(pixels.max(0) - before.max(0)).max() < 2
        assert np.abs(pixels.min(0) - before.min(0)).max() < 2


def test_staging_does_not_need_the_photo_again(blender: Any, tmp_path: Path) -> None:
    """An undo between two steps may free it; the mesh of the user's object is the base all the
    same.
    """
    photo = blender.data.images.new("pair.png", 8, 8)
    options = BuildOptions(name="pair", each=True, own_scene=False)
    prepared = prepare_objects(several_results(tmp_path), options)
    for one in place_objects(run_to_end(stage_objects(prepared, photo=photo)), photo=photo):
        one.object["isc_source_image"] = photo
        one.object.data["mine"] = 1
    steps = stage_objects(prepared, photo=photo)
    next(steps)
    again = photo.copy()
    photo.user_remap(again)
    blender.data.images.remove(photo)
    built = place_objects(run_to_end(steps), photo=again)
    assert [one.object.name for one in built] == ["pair 1", "pair 2"]
    assert [one.object.data.get("mine") for one in built] == [1, 1]


@pytest.mark.parametrize("light", ["OPTIMAL", "CHOSEN"])
def test_the_light_of_each_object_is_that_of_the_photo(
    addon: Any, tmp_path: Path, light: str
) -> None:
    """One sun replaces the recovered light, whichever object is active."""
    options = BuildOptions(name="pair", each=True)
    prepared = prepare_objects(several_results(tmp_path), options)
    largest, other = place_objects(run_to_end(stage_objects(prepared)))
    addon.context.window.scene = largest.scene
    for one in (other, largest, other):
        addon.context.view_layer.objects.active = one.object
        assert addon.ops.isc.relight(light=light) == {"FINISHED"}
        suns = [obj.name for obj in largest.scene.objects if obj.type == "LIGHT"]
        assert suns == [f"{largest.object.name} sun"]
        mix = sun_mix(largest.scene.world)
        assert mix is not None and mix.sun
    assert addon.ops.isc.relight(light="RECOVERED") == {"FINISHED"}
    assert not [obj for obj in largest.scene.objects if obj.type == "LIGHT"]
    mix = sun_mix(largest.scene.world)
    assert mix is not None and not mix.sun


def test_the_active_object_stays_active_when_all_are_updated(addon: Any, tmp_path: Path) -> None:
    several_results(tmp_path)
    request = DecomposeRequest(build=BuildOptions(name="pair", each=True, own_scene=False))
    addon.ops.isc.build_result(directory=str(tmp_path), request=request.to_json())
    assert addon.context.object.name == "pair 1"
    assert {one.name for one in addon.context.selected_objects} == {"pair 1", "pair 2"}
    addon.context.view_layer.objects.active = addon.data.objects["pair 2"]
    addon.ops.isc.build_result(directory=str(tmp_path), request=request.to_json())
    assert addon.context.object.name == "pair 2"


def test_the_message_names_an_object_in_an_excluded_collection(addon: Any, tmp_path: Path) -> None:
    results = several_results(tmp_path)
    request = DecomposeRequest(build=BuildOptions(own_scene=False))
    output = RunOutput(results[0].folder)
    assert result.build_as_undo_step(addon.context, output, request).startswith("bump created")
    entries = addon.context.view_layer.layer_collection.children
    entries["bump"].exclude = True
    assert result.build_as_undo_step(addon.context, output, request) == "bump updated"
    assert entries["bump"].exclude
