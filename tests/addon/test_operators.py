"""The operators as users call them: one real run from photo to object, and their errors."""

import importlib.util
import json
import re
import shutil
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon import operators  # noqa: E402
from blender_addon.operators.decompose import create_decompose_run  # noqa: E402
from blender_addon.operators.mask import box_from_corners  # noqa: E402
from blender_addon.operators.photo_operators import point_at  # noqa: E402
from blender_addon.operators.result import ISC_OT_read_result  # noqa: E402
from blender_addon.panels import read_notes, wrap_text  # noqa: E402
from blender_addon.runs import request as requests  # noqa: E402
from blender_addon.runs import run_steps, worker_run  # noqa: E402
from blender_addon.runs.active_run import begin_run  # noqa: E402
from blender_addon.runs.messages import (  # noqa: E402
    join_notes,
    notes_of_objects,
    sentence,
    translate_message,
)
from blender_addon.runs.request import (  # noqa: E402
    inspect_images,
    parse_points,
    request_from_settings,
)
from blender_addon.runs.worker_run import WorkerRun  # noqa: E402
from blender_addon.scene.built_object import find_built  # noqa: E402
from blender_addon.scene.preparation import BuildOptions, prepare  # noqa: E402
from blender_addon.settings import choices, preferences, presets, properties  # noqa: E402
from blender_addon.worker.process import WorkerUpdate  # noqa: E402
from isc_core.decomposition.pipeline import ILLUMINATIONS, MODELS  # noqa: E402
from isc_core.errors import InputError  # noqa: E402
from isc_core.result_files import diagnostics_text, reading_notes_text  # noqa: E402
from isc_core.separation import BEST, METHODS  # noqa: E402
from tests.addon.scene_fixture import bump, write_result  # noqa: E402


def picture(name: str, values: np.ndarray, **options: Any) -> Any:
    """An image of Blender's from (H, W, 3) values, row 0 at the top."""
    image = bpy.data.images.new(name, values.shape[1], values.shape[0], **options)
    opaque = np.concatenate([values, np.ones_like(values[..., :1])], axis=2).astype(np.float32)
    image.pixels.foreach_set(opaque[::-1].ravel())
    return image


def photo(name: str = "cup.png") -> Any:
    """The bump as a float photo on black."""
    return picture(name, bump().image, float_buffer=True)


def mask_image(name: str = "cup mask", size: tuple[int, int] = (64, 88)) -> Any:
    white = bump().mask if size == (64, 88) else np.ones(size, bool)
    return picture(name, np.repeat(white[..., None], 3, 2).astype(np.float32))


def error_of(operator: Any, **options: Any) -> str:
    """The error of an operator."""
    with pytest.raises(RuntimeError) as caught:
        operator(**options)
    return str(caught.value).strip().removeprefix("Error: ")


def census(blender: Any) -> dict[str, list[str]]:
    kinds = (
        "objects",
        "meshes",
        "materials",
        "images",
        "worlds",
        "scenes",
        "collections",
        "node_groups",
        "cameras",
        "texts",
    )
    return {kind: sorted(block.name for block in getattr(blender.data, kind)) for kind in kinds}


# --- from photo to object -------------------------------------------------------------------------


@pytest.mark.slow
def test_a_photo_becomes_an_object_and_is_decomposed_again_at_another_size(addon: Any) -> None:
    """One real run, of a painted photo with a name that is no file name."""
    addon.data.scenes[0].name = "Mine"
    settings = addon.context.scene.isc
    settings.own_scene = True
    settings.image, settings.separator, settings.max_size, settings.samples = (
        photo("Täss/chen 杯.png"),
        "shen_2013",
        36,
        3,
    )
    before = addon.context.scene.world, addon.context.scene.camera
    assert addon.ops.isc.decompose() == {"FINISHED"}
    shown = addon.context.window_manager.isc
    assert shown.state == "done"
    assert shown.message == "Täss_chen 杯 created in the scene Täss_chen 杯"
    assert "gloss: " in shown.notes
    built = find_built(addon.context.object)
    assert built is not None and built.scene == addon.context.scene and built.object.select_get()
    assert built.scene.cycles.samples == 3 and built.scene.isc.image == settings.image
    mine = addon.data.scenes["Mine"]
    assert (mine.world, mine.camera) == before and not mine.objects, "the user's scene is as before"
    folder = Path(built.object["isc_folder"])
    assert (folder / "mesh.glb").is_file() and folder.parent.name == "earlier"
    assert not list(Path(addon.app.tempdir).glob("isc_*")), "what was handed over has served"
    assert json.loads((folder / "decomposition.json").read_text())["settings"]["max_size"] == 36
    vertices = len(built.object.data.vertices)
    addon.ops.isc.recolour(hue=0.1)
    assert addon.ops.isc.redo(max_size=48) == {"FINISHED"}
    again = find_built(addon.context.object)
    assert (
        again is not None
        and again.object == built.object
        and len(again.object.data.vertices) > 1.4 * vertices
    )
    assert requests.request_from_json(again.object["isc_request"]).method.max_size == 48
    assert len(addon.data.meshes) == 1 and again.material.node_tree.nodes["ISC Dichromatic"].inputs[
        "Hue"
    ].default_value == pytest.approx(0.1)


@pytest.mark.slow
def test_a_box_is_cut_out_as_the_mask(addon: Any) -> None:
    d = bump()
    settings = addon.context.scene.isc
    settings.image = picture(
        "cup.png",
        np.where(d.mask[..., None], 3 * d.image + 0.2, [0.02, 0.25, 0.03]),
        float_buffer=True,
    )
    settings.box = (8, 1, 60, 54)
    for _ in range(2):  # the second replaces the first
        assert addon.ops.isc.cut_mask() == {"FINISHED"}
    assert (
        settings.mask_source == "IMAGE"
        and settings.mask.name == "cup.png mask"
        and settings.mask.packed_file is not None
    )
    assert [image.name for image in addon.data.images] == ["cup.png", "cup.png mask"]
    found = np.empty(len(settings.mask.pixels), np.float32)
    settings.mask.pixels.foreach_get(found)
    inside = found.reshape(64, 88, 4)[::-1, :, 0] > 0.5
    assert (inside & d.mask).sum() / (inside | d.mask).sum() > 0.9
    run = create_decompose_run(addon.context, request_from_settings(addon.context.scene))
    run.cancel()


def test_two_runs_at_once_are_refused(addon: Any, tmp_path: Path) -> None:
    addon.context.scene.isc.image = photo()
    before = census(addon)
    (tmp_path / "run").mkdir()
    begin_run(
        WorkerRun(
            "Decompose jug", (WorkerUpdate() for _ in "many"), lambda *_: "", tmp_path / "run"
        )
    )  # type: ignore[arg-type]
    assert not addon.ops.isc.decompose.poll()
    with pytest.raises(
        InputError, match="Decompose jug is running: wait for it, or cancel it first"
    ):
        create_decompose_run(addon.context, request_from_settings(addon.context.scene))
    assert census(addon) == before


# --- requests ----------------------------------------------------------------------------


def test_the_panel_offers_all_models_separators_and_illuminations() -> None:
    assert {item[0] for item in choices.MODELS} == set(MODELS)
    offered = {item[0] for item in choices.SEPARATORS}
    assert BEST in offered and offered <= set(METHODS)
    assert {item[0] for item in choices.ILLUMINATIONS} == set(ILLUMINATIONS)


def test_every_property_and_operator_has_a_tooltip(addon: Any) -> None:
    kinds: list[Any] = [*properties.CLASSES, preferences.ISC_AP_preferences, *operators.CLASSES]
    for kind in kinds:
        known = kind.bl_rna
        assert not issubclass(kind, addon.types.Operator) or kind.bl_description, kind
        for name in getattr(kind, "__annotations__", {}):
            if name in known.properties:
                assert len(known.properties[name].description) > 8, f"{kind.__name__}.{name}"
            for item in getattr(known.properties.get(name), "enum_items", ()):
                assert item.description, f"{kind.__name__}.{name}: {item.identifier}"


def test_presets_set_their_values(addon: Any) -> None:
    settings = addon.context.scene.isc
    assert settings.preset == "STANDARD", "the usual values are a preset"
    for name, preset in presets.PRESETS.items():
        settings.preset = name
        assert (settings.preset, settings.max_size, settings.model, settings.samples) == (
            name,
            preset.max_size,
            preset.model,
            preset.samples,
        )
        assert preset.model in MODELS
    settings.samples += 1
    assert settings.preset == "CUSTOM"
    settings.preset = "CUSTOM"
    assert settings.samples == presets.PRESETS["ULTRA"].samples + 1
    settings.preset = "DRAFT"
    assert settings.preset == "DRAFT"
    settings.preset = "CUSTOM"
    assert settings.preset == "CUSTOM", "with the values of the preset before"
    assert settings.samples == presets.PRESETS["DRAFT"].samples


def test_settings_are_saved_with_the_file(addon: Any, tmp_path: Path) -> None:
    settings = addon.context.scene.isc
    settings.image, settings.mask, settings.mask_source = photo(), mask_image(), "IMAGE"
    settings.model, settings.size_metres = "mbp", 0.4
    asked = request_from_settings(addon.context.scene)
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    addon.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert request_from_settings(addon.context.scene) == asked
    assert asked.build.size_metres == pytest.approx(0.4) and asked.method.model == "mbp"


def test_numbers_of_enumeration_items_never_change() -> None:
    """Files store them."""
    for items in (choices.MODELS, choices.SEPARATORS, choices.OWN_SHADOWS_ITEMS):
        assert [item[3] for item in items] == list(range(len(items)))
    assert [item[0] for item in choices.OWN_SHADOWS_ITEMS] == ["auto", "on", "off"]
    assert [item[0] for item in choices.SPECULAR_SOURCES] == ["lobe", "image", "none"]
    assert [item[0] for item in choices.MODELS][:4] == ["joint", "mdr", "mbp", "sirfs"]
    assert [item[0] for item in choices.SEPARATORS][:3] == ["isc", "network", "sparse_coding"]


def test_a_request_is_kept_as_text() -> None:
    asked = requests.DecomposeRequest(
        "a", "b", True, requests.MethodSettings(max_size=7), BuildOptions(name="杯"), "Scene"
    )
    assert requests.request_from_json(asked.to_json()) == asked
    later = json.loads(asked.to_json()) | {"of_a_later_version": 1}
    assert requests.request_from_json(json.dumps(later)) == asked
    for broken in ("", "null", "[]", "{}", '{"method": 3, "build": {}}'):
        with pytest.raises(InputError, match="does not store how it was created"):
            requests.request_from_json(broken)


def test_objects_of_two_photos_have_different_keys(addon: Any, tmp_path: Path) -> None:
    first, second = photo("cup.png"), photo("cup.jpg")
    assert requests.object_key(first) == requests.object_key(second) == "cup"
    obj = addon.data.objects.new("cup", None)
    obj["isc_key"] = "cup"
    requests.store_request(obj, requests.DecomposeRequest(image="cup.png"))
    assert (requests.object_key(first), requests.object_key(second)) == ("cup", "cup.jpg")
    second.name = "cup.png"
    assert second.name == "cup.png.001"
    assert requests.object_key(second) == "cup", "it is numbered when it is built"


def test_a_photo_that_was_renamed_keeps_the_name_of_its_object(addon: Any) -> None:
    image = photo("cup.png")
    for number, each in enumerate((True, False)):
        obj = addon.data.objects.new("any", None)
        obj["isc_key"] = ("cup 1", "cup-2")[number]
        build = BuildOptions(name="cup", each=each)
        requests.store_request(obj, requests.DecomposeRequest(image="cup.png", build=build))
    image.name = "my cup.png"
    assert requests.object_key(image) == "cup-2"
    assert requests.object_key(image, each=True) == "cup"


def test_kept_results_go_to_the_cache_folder(addon: Any, tmp_path: Path) -> None:
    folder = preferences.create_run_folder(tmp_path / "results", "a/b: 杯 ..")
    assert folder.parent == tmp_path / "results" and folder.name.startswith("isc_a_b__杯____")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="choose another folder in the add-on's preferences"):
        preferences.create_run_folder(tmp_path / "file" / "x", "cup")


# --- errors ---------------------------------------------------------------------------------------


def masked(settings: Any, mask: Any) -> None:
    settings.image, settings.mask_source = photo(), "IMAGE"
    settings.mask = mask or settings.image


def without_mask(settings: Any) -> None:
    settings.image, settings.mask_source = photo(), "IMAGE"


def set_image(settings: Any, values: np.ndarray) -> None:
    settings.image = picture("wall", values)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("prepare", "complaint"),
    [
        (lambda s: None, "Open a photo first"),
        (lambda s: set_image(s, np.ones((1, 1, 3))), "is 1 x 1 pixels: choose a larger one"),
        (without_mask, "No mask image is selected: choose one"),
        (
            lambda s: masked(s, bpy.data.images.new("m", 88, 64)),
            "The mask m is empty: paint the object white on black",
        ),
        (
            lambda s: masked(s, mask_image(size=(20, 30))),
            "The mask is 30 x 20 pixels, the photo 88 x 64: "
            "choose another mask, or enable Scale Mask",
        ),
        (lambda s: masked(s, None), "is the photo itself"),
        (lambda s: set_image(s, np.zeros((32, 32, 3))), "wall: every pixel is black"),
        (
            lambda s: set_image(s, 0.3 + np.indices((32, 32, 3)).sum(0) / 200),
            "choose a mask image, or make one with Add Point or Select Box",
        ),
    ],
)
def test_invalid_input_is_reported_and_changes_nothing(
    addon: Any, prepare: Any, complaint: str
) -> None:
    prepare(addon.context.scene.isc)
    before, folders = census(addon), list(Path(addon.app.tempdir).iterdir())
    assert complaint in error_of(addon.ops.isc.decompose)
    after = census(addon)
    after["texts"].clear()  # a report of the worker may be there
    assert after == before and list(Path(addon.app.tempdir).iterdir()) == folders


def test_a_mask_of_another_size_is_scaled_if_enabled(addon: Any) -> None:
    settings = addon.context.scene.isc
    settings.image, settings.mask_source, settings.mask = (
        photo(),
        "IMAGE",
        mask_image(size=(32, 44)),
    )
    settings.scale_mask = True
    run = create_decompose_run(addon.context, request_from_settings(addon.context.scene))
    folder = run.folder
    while not (folder / "mask.npy").exists():
        assert run.step().state == "running", run.status.message
    while run.status.stage != "starting the worker":
        run.step()
    assert np.load(folder / "mask.npy").shape == (64, 88)
    run.cancel()


def test_a_mask_that_fits_is_not_scaled(addon: Any) -> None:
    settings = addon.context.scene.isc
    shown = photo()
    width, height = shown.size
    settings.image, settings.mask_source = shown, "IMAGE"
    settings.mask = mask_image(size=(height, width))
    settings.scale_mask = True
    wanted = request_from_settings(addon.context.scene)
    assert inspect_images(wanted)[2] is None


def test_a_missing_worker_is_reported(addon: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    addon.context.scene.isc.image = photo()
    assert "The worker is missing" in error_of(addon.ops.isc.decompose)


@pytest.mark.slow
def test_a_point_finds_the_mask(addon: Any) -> None:
    d = bump()
    settings = addon.context.scene.isc
    settings.image = picture(
        "cup.png",
        np.where(d.mask[..., None], 3 * d.image + 0.2, [0.02, 0.25, 0.03]),
        float_buffer=True,
    )
    rows, columns = np.nonzero(d.mask)
    settings.points = f"{round(columns.mean())},{round(rows.mean())}"
    settings.other_points = "1,1"
    assert addon.ops.isc.auto_mask() == {"FINISHED"}
    assert settings.mask_source == "IMAGE" and settings.mask.name == "cup.png mask"
    found = np.empty(len(settings.mask.pixels), np.float32)
    settings.mask.pixels.foreach_get(found)
    inside = found.reshape(64, 88, 4)[::-1, :, 0] > 0.5
    assert (inside & d.mask).sum() / (inside | d.mask).sum() > 0.8
    assert addon.ops.isc.clear_points() == {"FINISHED"} and not settings.points
    settings.points = "900,3"
    assert "lies outside of the photo" in error_of(addon.ops.isc.auto_mask)
    settings.image = photo()
    assert not settings.points, "points belong to one photo"


def test_marked_highlights_reach_the_request(addon: Any) -> None:
    settings = addon.context.scene.isc
    settings.image = photo()
    settings.highlights, settings.not_highlights = "40,20", "3,4 5,6"
    method = request_from_settings(addon.context.scene).method
    assert (method.highlights, method.not_highlights) == ("40,20", "3,4 5,6")
    assert addon.ops.isc.clear_highlights() == {"FINISHED"}
    assert not settings.highlights and not settings.not_highlights
    settings.highlights = "40,20"
    settings.image = picture("other.png", np.full((8, 8, 3), 0.5), float_buffer=True)
    assert not settings.highlights, "marks belong to one photo"


def test_wrong_points_are_refused(addon: Any) -> None:
    settings = addon.context.scene.isc
    settings.image = photo()
    settings.points = "12;4"
    assert "'12;4' is not a point" in error_of(addon.ops.isc.auto_mask)


@pytest.mark.parametrize(
    ("place", "point"),
    [((0.0, 1.0), (0, 0)), ((0.999, 0.001), (99, 199)), ((0.5, 0.25), (50, 150)), ((1, 0.5), None)],
)
def test_a_click_is_a_pixel_from_the_top(place: tuple[float, float], point: Any) -> None:
    assert point_at(place, (100, 200)) == point


def test_points_are_read_from_text() -> None:
    assert parse_points(" 3,4  10,0 ") == [(3, 4), (10, 0)] and parse_points("") == []


@pytest.mark.slow
def test_an_empty_box_is_refused(addon: Any) -> None:
    settings = addon.context.scene.isc
    settings.image = photo()
    assert "The box is less than 8 pixels wide or high" in error_of(addon.ops.isc.cut_mask)
    settings.box = (0, 0, 88, 64)
    assert "covers the whole image" in error_of(addon.ops.isc.cut_mask)
    assert settings.mask is None and len(addon.data.images) == 1


def test_a_new_mask_has_the_photos_size(addon: Any) -> None:
    settings = addon.context.scene.isc
    assert "No photo is selected" in error_of(addon.ops.isc.new_mask)
    settings.image = photo()
    assert addon.ops.isc.new_mask() == {"FINISHED"}
    assert tuple(settings.mask.size) == (88, 64) and settings.mask_source == "IMAGE"


# --- results --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_folder_is_imported_into_the_users_scene(addon: Any, bump_folder: Path) -> None:
    scene = addon.context.scene
    scene.isc.own_scene = False
    scene.isc.each = True  # of photos; a folder is one result
    world, camera = scene.world, scene.camera
    assert addon.ops.isc.import_result(directory=str(bump_folder)) == {"FINISHED"}
    built = find_built(addon.context.object)
    assert (
        built is not None
        and built.scene == scene
        and (scene.world, scene.camera) == (world, camera)
        and len(addon.data.scenes) == 1
    )
    assert (bump_folder / "arrays.npz").is_file(), "a folder of the user's own stays as it is"


@pytest.mark.parametrize(
    ("chosen", "own", "cast"),
    [("auto", True, False), ("auto", False, True), ("on", True, True), ("off", False, False)],
)
def test_shadows_are_as_chosen(
    addon: Any, bump_folder: Path, chosen: str, own: bool, cast: bool
) -> None:
    settings = addon.context.scene.isc
    settings.shadows, settings.own_scene = chosen, own
    assert addon.ops.isc.import_result(directory=str(bump_folder)) == {"FINISHED"}
    made = next(obj for obj in addon.data.objects if obj.type == "MESH" and find_built(obj))
    assert (made.visible_shadow, made.visible_diffuse) == (cast, cast)


@pytest.mark.slow
def test_missing_arrays_are_added_to_a_folder(addon: Any, tmp_path: Path) -> None:
    from isc_core.result_files.result_folder import save

    save(bump(), tmp_path / "cup")
    assert addon.ops.isc.import_result(directory=str(tmp_path / "cup")) == {"FINISHED"}
    assert (
        find_built(addon.context.object) is not None and (tmp_path / "cup" / "arrays.npz").is_file()
    )


def imported_until(addon: Any, folder: Path, ready: bool) -> WorkerRun:
    """An import from the file browser that has begun, until it is ready or one step further."""
    operator = SimpleNamespace(directory=str(folder))
    run = begin_run(ISC_OT_read_result.prepare(operator, addon.context))  # type: ignore[arg-type]
    while run.step().state == "running":
        time.sleep(0.01)
    if not ready:
        run.import_result(addon.context)
    return run


@pytest.mark.parametrize("ready", [True, False])
def test_a_cancelled_import_leaves_nothing(
    addon: Any, bump_folder: Path, ready: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_run, "IMPORT_SECONDS", 0.0)  # one step at a time
    before = census(addon)
    run = imported_until(addon, bump_folder, ready)
    assert run.status.state == "ready" and (ready or census(addon) != before)
    run.cancel()
    assert run.status.state == "cancelled" and census(addon) == before
    assert not run.folder.exists() and (bump_folder / "arrays.npz").is_file()


def test_an_import_prepares_in_a_thread_what_the_panel_said(
    addon: Any, bump_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = []

    def noted(*arguments: Any, **options: Any) -> Any:
        threads.append(threading.current_thread())
        return prepare(*arguments, **options)

    monkeypatch.setattr(run_steps, "prepare", noted)
    addon.context.scene.isc.size_metres = 0.3
    run = imported_until(addon, bump_folder, True)
    addon.context.scene.isc.size_metres = 0.7  # for the next one
    while not run.ended:
        run.import_result(addon.context)
    assert threads and threading.main_thread() not in threads
    assert max(addon.context.object.dimensions) == pytest.approx(0.3, rel=0.02)
    assert run.status.message.startswith("bump created") and not run.folder.exists()


def test_an_import_waits_for_the_run_that_is_active(addon: Any, bump_folder: Path) -> None:
    run = imported_until(addon, bump_folder, True)
    message = error_of(addon.ops.isc.import_result, directory=str(bump_folder))
    assert message == "Import bump is running: wait for it, or cancel it first"
    run.cancel()


def test_a_folder_without_a_result_is_refused(
    addon: Any, tmp_path: Path, bump_folder: Path
) -> None:
    before = census(addon)
    assert "is not a result: select a folder written by isc decompose" in error_of(
        addon.ops.isc.import_result, directory=str(tmp_path)
    )
    shutil.copytree(bump_folder, tmp_path / "broken")
    (tmp_path / "broken" / "arrays.npz").write_bytes(b"nothing")
    assert "is damaged" in error_of(addon.ops.isc.import_result, directory=str(tmp_path / "broken"))
    assert census(addon) == before


def test_the_same_object_is_updated(addon: Any, bump_folder: Path) -> None:
    addon.ops.isc.import_result(directory=str(bump_folder))
    once = census(addon)
    addon.ops.isc.import_result(directory=str(bump_folder))
    assert census(addon) == once


def test_photos_of_one_name_become_separate_objects(
    addon: Any, bump_folder: Path, tmp_path: Path
) -> None:
    """From two folders; stored requests use the name of the object."""
    addon.ops.isc.import_result(directory=str(bump_folder))
    first = addon.context.object
    about = json.loads((bump_folder / "decomposition.json").read_text())
    shutil.copytree(bump_folder, tmp_path / "bump")
    about["input"]["sha256"] = 64 * "1"
    (tmp_path / "bump" / "decomposition.json").write_text(json.dumps(about))
    addon.ops.isc.import_result(directory=str(tmp_path / "bump"))
    second = addon.context.object
    assert second != first and (first["isc_key"], second["isc_key"]) == ("bump", "bump-2")
    assert first["isc_photo_sha256"] == 64 * "0" and second["isc_photo_sha256"] == 64 * "1"
    assert json.loads(second["isc_request"])["build"]["name"] == "bump-2"
    for folder, obj in ((bump_folder, first), (tmp_path / "bump", second)):
        addon.ops.isc.import_result(directory=str(folder))
        assert addon.context.object == obj
    assert sum(obj.type == "MESH" for obj in addon.data.objects) == 2


@pytest.mark.slow
def test_the_request_is_appended_with_the_object(addon: Any, tmp_path: Path) -> None:
    addon.context.scene.isc.image = photo()
    request = request_from_settings(addon.context.scene)
    addon.ops.isc.build_result(
        directory=str(write_result(tmp_path / "cup")), request=request.to_json()
    )
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    addon.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    addon.ops.wm.append(directory=str(tmp_path / "a.blend" / "Object"), filename="cup")
    obj = addon.data.objects["cup"]
    again = requests.stored_request(obj, addon.context.scene, 99)
    assert again.image == "cup.png" and again.method.max_size == 99
    addon.data.images.remove(addon.data.images["cup.png"])
    with pytest.raises(InputError, match="the photo of cup is not in this file"):
        requests.stored_request(obj, addon.context.scene, 99)


# --- messages -------------------------------------------------------------------------------------


def test_messages_name_images_and_panel_fields() -> None:
    assert translate_message(
        "/t/a.npy: the mask is 1 x 1 pixels, the photo 2 x 2: give a mask of the photo's size",
        {"/t/a.npy": "cup"},
    ) == ("cup: the mask is 1 x 1 pixels, the photo 2 x 2: give a mask of the photo's size")
    assert (
        translate_message("--max-size 9 leaves the object thin", {})
        == "Size 9 leaves the object thin"
    )
    for advice in (
        "make a mask with `isc mask PHOTO --box x,y,w,h -o MASK`",
        "give another --mask",
    ):
        assert translate_message(f"/t/a.npy: no object: {advice}", {"/t/a.npy": "cup"}) == (
            "cup: no object: choose a mask image, or make one with Add Point or Select Box"
        )
    assert translate_message(
        "no object found there: put --point on it, or --box around it", {}
    ) == ("no object found there: choose a mask image, or make one with Add Point or Select Box")
    several = "it seems to show several objects: give --mask; --each processes each of them"
    assert translate_message(several, {}).endswith("or Select Box, or enable Each Object")


def test_notes_speak_of_the_panel_in_blenders_spelling() -> None:
    """Every sentence that a result can have: no option of the command line is left in it."""
    texts = [
        *(diagnostics_text.STRONG_COLOUR, diagnostics_text.CROPPED, diagnostics_text.COLOURED),
        diagnostics_text.WHITE_ASSUMED,
        *diagnostics_text._COLOURS.values(),
        *diagnostics_text._WARNINGS.values(),
        *diagnostics_text._LOBE.values(),
        *diagnostics_text._LOBE_STATUS.values(),
        *reading_notes_text._TEXTS.values(),
    ]
    for text in texts:
        shown = translate_message(text, {})
        assert not re.search(r"--[a-z]|colour|grey|odds", shown), shown
    assert translate_message(diagnostics_text.COLOURED, {}).endswith("set Light Color to Estimate")
    assumed = translate_message(diagnostics_text.WHITE_ASSUMED, {})
    assert assumed.endswith("set Light Color to Custom")
    named = translate_message("/t/a.png: it is grey", {"/t/a.png": "my grey colour chart"})
    assert named == "my grey colour chart: it is gray"


def test_notes_are_joined_into_one_line() -> None:
    assert (
        join_notes(["note: not converged", "gloss: none ", ""])
        == "note: not converged; gloss: none"
    )


def test_messages_begin_with_a_capital_unless_it_is_a_name() -> None:
    assert (
        sentence("the mask is the photo itself: choose") == "The mask is the photo itself: choose"
    )
    assert sentence("no photo is selected") == "No photo is selected"
    for named in ("cup updated", "a.png: every pixel is black", "therapy created", ""):
        assert sentence(named) == named


def test_notes_are_shown_without_their_mark() -> None:
    advice, notes = read_notes("note: the light is colored\ngloss: roughness 0.20")
    assert advice == ["The light is colored"]
    assert notes == ["The light is colored", "Gloss: roughness 0.20"]


def test_text_is_wrapped() -> None:
    assert wrap_text("one two three", 7) == ["one two", "three"]
    assert wrap_text("unbreakable", 3) == ["unbreakable"] and wrap_text("", 5) == [""]


@pytest.mark.parametrize(
    ("first", "second", "box"),
    [
        ((0.25, 0.75), (0.75, 0.25), (25, 50, 50, 100)),
        ((0.75, 0.25), (0.25, 0.75), (25, 50, 50, 100)),
        ((-1.0, 2.0), (0.5, 0.5), (0, 0, 50, 100)),
        ((0.5, 0.5), (0.55, 0.55), None),
        ((1.5, 1.5), (2.0, 2.0), None),
    ],
)
def test_a_drawn_box_is_measured_from_the_top(
    first: tuple[float, float], second: tuple[float, float], box: Any
) -> None:
    assert box_from_corners(first, second, (100, 200)) == box


def test_notes_name_the_objects_that_they_are_about() -> None:
    """The expected errors of two objects differ, and advice may concern one of three."""
    assert notes_of_objects({"result": ["note: dark", "error: 3"]}) == ["note: dark", "error: 3"]
    notes = {"1": ["note: dark", "error: 3"], "2": ["error: 4"], "3": ["note: dark", "error: 4"]}
    assert notes_of_objects(notes | {"2": ["error: 4", "flat"]}) == [
        "note: objects 1, 3: dark",
        "object 1: error: 3",
        "objects 2, 3: error: 4",
        "object 2: flat",
    ]
    assert notes_of_objects({"1": ["flat"], "2": ["flat"]}) == ["flat"]
