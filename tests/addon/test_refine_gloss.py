"""*Refine Gloss*: the choice reaches the worker, its outcome the message, its lamps the scene."""

import json
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.headless_command import _parser  # noqa: E402
from blender_addon.operators.decompose import create_decompose_run  # noqa: E402
from blender_addon.runs import run_steps  # noqa: E402
from blender_addon.runs.request import request_from_settings, stored_request  # noqa: E402
from blender_addon.worker.commands import DecomposeJob, start_decompose  # noqa: E402
from blender_addon.worker.pace import Pace  # noqa: E402
from blender_addon.worker.process import WorkerState, WorkerUpdate  # noqa: E402
from isc_core.imaging.srgb import linear_to_srgb  # noqa: E402
from tests.addon.scene_fixture import bump, write_result  # noqa: E402
from tests.addon.test_headless import run  # noqa: E402
from tests.core.refinement.test_gloss import glossy  # noqa: E402


def dome_values() -> np.ndarray:
    """A red dome with the highlight of one lamp, clipped in its middle, on black; sRGB."""
    d = glossy(96, lean=0.0)
    light = d.diffuse * np.array([1.4, 0.5, 0.3], np.float32) + 4 * d.specular
    return linear_to_srgb(np.minimum(light, 1))


def dome_photo() -> Any:
    """The dome as an image of 8 bits."""
    values = dome_values()
    image = bpy.data.images.new("dome.png", 96, 96)
    opaque = np.concatenate([values, np.ones_like(values[..., :1])], axis=2)
    image.pixels.foreach_set(opaque[::-1].astype(np.float32).ravel())
    return image


def ask(addon: Any) -> Any:
    """The panel's settings for the dome, refined."""
    settings = addon.context.scene.isc
    settings.image, settings.max_size, settings.own_scene = dome_photo(), 96, True
    settings.highlight_odds, settings.refine = "0", True
    return settings


@pytest.mark.slow
def test_a_refined_object_has_lamps_and_the_message_says_so(addon: Any) -> None:
    ask(addon)
    assert addon.ops.isc.decompose() == {"FINISHED"}
    shown = addon.context.window_manager.isc
    said, line = shown.message.split("; ")
    assert said == "dome created in the scene dome"
    assert line.startswith("gloss refined: 1 lamp explains ") and line in shown.notes
    lamps = [o for o in bpy.data.objects if o.get("isc_role") == "lamp1"]
    assert len(lamps) == 1 and lamps[0].type == "LIGHT"
    obj = addon.context.object
    assert stored_request(obj, addon.context.scene, 64).method.refine, "Update refines again"
    for light, hidden in (("OPTIMAL", True), ("RECOVERED", False)):
        assert addon.ops.isc.relight(light=light) == {"FINISHED"}
        assert lamps[0].hide_render == hidden, "the sun lights highlights itself"


@pytest.mark.slow
def test_the_refinement_is_cancelled_at_once(addon: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    workers: list[Any] = []

    def started(*given: Any) -> Any:
        workers.append(start_decompose(*given))
        return workers[0]

    monkeypatch.setattr(run_steps, "start_decompose", started)
    ask(addon)
    run = create_decompose_run(addon.context, request_from_settings(addon.context.scene))
    end = time.monotonic() + 120
    while run.step().stage != "refining the gloss":
        assert run.status.state == "running" and time.monotonic() < end, run.status.message
        time.sleep(0.01)
    run.cancel()
    while workers[0].poll().state == "running":
        assert time.monotonic() < end
        time.sleep(0.01)
    assert workers[0].poll().state == "cancelled"


@pytest.mark.parametrize("refine", [False, True])
def test_the_choice_reaches_the_job_and_the_outcome_the_message(
    addon: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refine: bool
) -> None:
    """Of a worker that writes a result whose gloss could not be refined, if that was asked for."""
    jobs: list[DecomposeJob] = []

    class Done:
        def poll(self) -> WorkerUpdate:
            return WorkerUpdate("done", 1.0, WorkerState.DONE)

        def kill(self) -> None:
            """Nothing to end."""

    def start(job: DecomposeJob, environment: Any) -> Done:
        jobs.append(job)
        folder = write_result(job.output, bump())
        text = json.loads((folder / "decomposition.json").read_text())
        if job.refine:
            text["settings"]["refine_gloss"] = {"outcome": "no_highlight", "lamps": 0}
        (folder / "decomposition.json").write_text(json.dumps(text))
        return Done()

    monkeypatch.setattr(run_steps, "start_decompose", start)
    ask(addon).refine = refine
    run = create_decompose_run(addon.context, request_from_settings(addon.context.scene))
    end = time.monotonic() + 60
    while not run.ended:
        run.step()
        run.import_result(addon.context)
        assert time.monotonic() < end
    assert jobs[0].refine is refine
    reason = "; gloss not refined: no highlight of known roughness was separated"
    assert run.status.message == "dome created in the scene dome" + reason * refine


@pytest.mark.slow
def test_the_script_refines_and_says_so(tmp_path: Path) -> None:
    picture = np.rint(255 * dome_values()).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "dome.png"), picture[..., ::-1])
    words = [tmp_path / "dome.png", "--refine", "--highlight-odds", "0", "--max-size", "96"]
    done = run(*words, "-o", tmp_path / "dome.blend", "--results", tmp_path / "kept")
    assert done.returncode == 0, done.stderr
    assert "gloss refined: 1 lamp explains " in done.stdout
    assert "lamp_direction" in np.load(tmp_path / "kept" / "dome" / "arrays.npz").files


def test_the_script_refines_on_request() -> None:
    assert _parser().parse_args(["a.png", "--refine"]).refine
    assert not _parser().parse_args(["a.png"]).refine


def test_the_time_of_the_refinement_is_in_the_progress() -> None:
    plain, refined = Pace(512), Pace(512, refine=True)
    begun, ended = (refined.at(WorkerUpdate("x", part), 20.0).fraction for part in (0.7, 0.8))
    assert plain.at(WorkerUpdate("x", 0.7), 20.0).fraction > begun
    assert ended - begun > 0.4, "the longest stage"
    assert refined.at(WorkerUpdate("x", 1.0), 40.0).fraction == pytest.approx(1)
