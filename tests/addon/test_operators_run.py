"""A run in steps: progress, outcomes, and that nothing remains unless it succeeds."""

import shutil
import sys
import time
from collections.abc import Callable, Generator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

import blender_addon  # noqa: E402 (after the skip)
from blender_addon.files.image_source import ImageSource  # noqa: E402
from blender_addon.operators.modal import WorkerOperator, advance_run  # noqa: E402
from blender_addon.runs import run_steps  # noqa: E402
from blender_addon.runs.active_run import active_run, begin_run, cancel_active_run  # noqa: E402
from blender_addon.runs.request import MethodSettings  # noqa: E402
from blender_addon.runs.run_steps import ResultDestination, decompose_steps, mask_steps  # noqa: E402
from blender_addon.runs.worker_run import (  # noqa: E402
    ImportSteps,
    RunOutput,
    RunSteps,
    WorkerFailed,
    WorkerRun,
    follow_worker,
    remove_folder,
)
from blender_addon.worker.commands import WorkerEnvironment, start_decompose  # noqa: E402
from blender_addon.worker.process import WorkerProcess, WorkerUpdate  # noqa: E402
from isc_core.errors import InputError  # noqa: E402

# A package in place of `isc_core` that takes its time, or dies.
SLOW = """
import json, sys, time
print(json.dumps({"event": "progress", "stage": "solving", "fraction": 0.25}), flush=True)
while True: time.sleep(0.05)
"""
CRASH = "import os, sys\nprint('half way through', file=sys.stderr, flush=True)\nos.abort()\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A run's own folder with something in it."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "photo.npy").write_text("x")
    return tmp_path / "run"


def fake_core(tmp_path: Path, code: str) -> WorkerEnvironment:
    package = tmp_path / "fake_core" / "isc_core"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "__main__.py").write_text(code)
    return WorkerEnvironment(Path(sys.executable), (package.parent,), tmp_path / "cache")


def script(
    steps: int, result: Path, closed: list[str] | None = None
) -> Generator[WorkerUpdate, None, RunOutput]:
    try:
        for number in range(steps):
            yield WorkerUpdate("at work", number / steps)
    finally:
        if closed is not None:
            closed.append("closed")
    return RunOutput(result)


def failing(error: Exception) -> Generator[WorkerUpdate, None, RunOutput]:
    yield WorkerUpdate("at work")
    raise error


def take(_context: Any, output: RunOutput) -> ImportSteps:
    yield from ()
    return f"took {output.path.name}"


def until(true: Callable[[], object], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.02)


def has_ended(process: str) -> bool:
    """Whether a process is gone, or waits for the system to take note of its end."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return True
    return state == "Z"


def test_a_run_ends_by_importing_its_result(folder: Path) -> None:
    run = WorkerRun("Decompose cup", script(2, folder), take, folder)
    assert [run.step().state for _ in range(4)] == ["running", "running", "ready", "ready"]
    assert not run.ended
    assert (run.import_result(None).state, run.status.message, run.ended) == (
        "done",
        "took run",
        True,
    )
    assert folder.is_dir(), "what is kept is for others to decide"


def test_stage_and_fraction_are_passed_on(folder: Path) -> None:
    run = WorkerRun("Decompose cup", script(4, folder), take, folder)
    run.step()
    run.step()
    assert (run.status.stage, run.status.fraction) == ("at work", 0.25)


@pytest.mark.parametrize(
    ("error", "report"),
    [(InputError("no room"), ""), (WorkerFailed("no room", "the log"), "the log")],
)
def test_a_failure_is_reported_and_leaves_nothing(
    folder: Path, error: Exception, report: str
) -> None:
    run = WorkerRun("Decompose cup", failing(error), take, folder)
    run.step()
    assert run.step().state == "failed"
    assert (run.status.message, run.status.log) == ("no room", report)
    assert not folder.exists()


def test_a_result_that_cannot_be_built_leaves_nothing(folder: Path) -> None:
    def refuse(_context: Any, _output: RunOutput) -> ImportSteps:
        yield from ()
        raise InputError("linked")

    run = WorkerRun("Decompose cup", script(0, folder), refuse, folder)
    run.step()
    assert (run.import_result(None).state, run.status.message, folder.exists()) == (
        "failed",
        "linked",
        False,
    )


def test_notes_on_the_result_are_passed_on(folder: Path) -> None:
    def talkative() -> Generator[WorkerUpdate, None, RunOutput]:
        yield WorkerUpdate("at work")
        return RunOutput(folder, ("note: it did not converge", "gloss: 0.2"))

    run = WorkerRun("Decompose cup", talkative(), take, folder)
    run.step()
    run.step()
    status = run.import_result(None)
    assert status.message == "took run", "one short line"
    assert status.notes == ("note: it did not converge", "gloss: 0.2")


@pytest.mark.parametrize("where", ["script", "finish"])
def test_an_unexpected_error_does_not_block_the_next_run(folder: Path, where: str) -> None:
    def broken(_context: Any, _output: RunOutput) -> ImportSteps:
        yield from ()
        raise ZeroDivisionError("an error of ours")

    steps = (
        failing(ZeroDivisionError("an error of ours")) if where == "script" else script(1, folder)
    )
    run = begin_run(WorkerRun("Decompose cup", steps, broken, folder))
    run.step()
    with pytest.raises(ZeroDivisionError):
        run.step() and run.import_result(None)
    assert (
        active_run() is None
        and run.status.state == "failed"
        and "an error of ours" in run.status.message
    )
    assert not folder.exists()


def test_cancelling_closes_the_steps_and_removes_the_folder(folder: Path) -> None:
    closed: list[str] = []
    run = WorkerRun("Decompose cup", script(5, folder, closed), take, folder)
    run.step()
    run.cancel()
    assert (run.status.state, run.status.message, closed) == (
        "cancelled",
        "Decompose cup: cancelled",
        ["closed"],
    )
    assert run.step().state == "cancelled" and run.import_result(None).state == "cancelled"
    assert not folder.exists()


def test_cancelling_after_the_end_changes_nothing(folder: Path) -> None:
    run = WorkerRun("Decompose cup", script(0, folder), take, folder)
    run.step()
    run.import_result(None)
    assert run.cancel().state == "done" and folder.is_dir()


def test_too_little_memory_is_said_in_one_line(folder: Path) -> None:
    def hungry() -> Generator[WorkerUpdate, None, RunOutput]:
        yield WorkerUpdate("reading the result")
        raise MemoryError("Unable to allocate 40 GiB")

    run = WorkerRun("Create cup", hungry(), take, folder)
    run.step()
    assert run.step().state == "failed" and not folder.exists()
    assert run.status.message.endswith("choose a smaller Texture Size or Size")


def test_calls_and_import_are_timed(folder: Path) -> None:
    def slow_script() -> Generator[WorkerUpdate, None, RunOutput]:
        yield WorkerUpdate("quick")
        time.sleep(0.03)
        yield WorkerUpdate("slow")
        return RunOutput(folder)

    def slow_import(_context: Any, _output: RunOutput) -> ImportSteps:
        for _ in range(3):
            time.sleep(0.1)
            yield
        return ""

    run = WorkerRun("Decompose cup", slow_script(), slow_import, folder)
    run.step()
    assert run.longest_call_ms < 30
    while run.step().state == "running":
        pass
    while not run.ended:
        run.import_result(None)
    assert 30 <= run.longest_call_ms < 300 <= run.import_ms


def test_two_runs_at_once_are_refused(tmp_path: Path, folder: Path) -> None:
    first = begin_run(WorkerRun("Decompose cup", script(5, folder), take, folder))
    (tmp_path / "second").mkdir()
    try:
        with pytest.raises(
            InputError, match="Decompose cup is running: wait for it, or cancel it first"
        ):
            begin_run(WorkerRun("Decompose jug", script(5, folder), take, tmp_path / "second"))
        assert active_run() is first and not (tmp_path / "second").exists()
    finally:
        cancel_active_run()
    assert active_run() is None and first.status.state == "cancelled"


def test_a_folder_that_is_still_written_to_is_removed_eventually(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run").mkdir()
    whole, calls = shutil.rmtree, []

    def busy(path: Path, ignore_errors: bool = False) -> None:
        calls.append(path)
        if len(calls) > 2:
            whole(path, ignore_errors=ignore_errors)

    monkeypatch.setattr(shutil, "rmtree", busy)
    remove_folder(tmp_path / "run")
    assert (tmp_path / "run").exists(), "the first try was too early"
    until(lambda: not (tmp_path / "run").exists())


# --- workers --------------------------------------------------------------------------------------


def photo_file(tmp_path: Path) -> ImageSource:
    (tmp_path / "cup.png").write_text("never read")
    return ImageSource("cup", path=tmp_path / "cup.png")


def steps_of(photo: ImageSource, folder: Path, environment: WorkerEnvironment) -> RunSteps:
    place = ResultDestination(folder)
    return decompose_steps(photo, None, None, MethodSettings(), place, 0, environment)


def test_cancelling_kills_the_worker_and_removes_what_it_wrote(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment, workers = fake_core(tmp_path, SLOW), []

    def started(*given: Any) -> WorkerProcess:
        workers.append(start_decompose(*given))
        return workers[0]

    monkeypatch.setattr(run_steps, "start_decompose", started)
    steps = steps_of(photo_file(tmp_path), folder, environment)
    run = WorkerRun("Decompose cup", steps, take, folder)
    until(lambda: run.step().stage == "solving")
    assert workers[0].poll().state == "running"
    run.cancel()
    until(lambda: workers[0].poll().state == "cancelled")
    assert workers[0].exit_code is not None
    until(lambda: not folder.exists())
    assert (tmp_path / "cup.png").is_file(), "the user's own file stays"


def test_a_starting_worker_is_ended_too(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment, workers = fake_core(tmp_path, SLOW), []

    def slow_start(*given: Any) -> WorkerProcess:
        time.sleep(0.3)
        workers.append(start_decompose(*given))
        return workers[0]

    monkeypatch.setattr(run_steps, "start_decompose", slow_start)
    steps = steps_of(photo_file(tmp_path), folder, environment)
    run = WorkerRun("Decompose cup", steps, take, folder)
    until(lambda: run.step().stage == "starting the worker")
    run.cancel()
    assert not workers
    until(lambda: workers and workers[0].poll().state == "cancelled")
    assert workers[0].exit_code is not None


def test_a_crash_is_reported_with_the_logs_tail(tmp_path: Path, folder: Path) -> None:
    script = mask_steps(photo_file(tmp_path), (0, 0, 9, 9), folder, fake_core(tmp_path, CRASH))
    run = WorkerRun("Cut Out", script, take, folder)
    until(lambda: run.step().state != "running")
    assert run.status.state == "failed" and "killed (SIGABRT)" in run.status.message
    assert "half way through" in run.status.log
    assert not folder.exists()


def test_a_worker_that_cannot_start_is_reported(tmp_path: Path, folder: Path) -> None:
    environment = WorkerEnvironment(tmp_path / "no_python", (), tmp_path / "cache")
    run = WorkerRun(
        "Cut Out", mask_steps(photo_file(tmp_path), (0, 0, 9, 9), folder, environment), take, folder
    )
    until(lambda: run.step().state != "running")
    assert run.status.state == "failed" and "cannot start the worker" in run.status.message


def test_messages_name_images_not_files(tmp_path: Path, folder: Path) -> None:
    code = """
import json, sys
message = f"{sys.argv[2]}: make a mask with `isc mask PHOTO --box x,y,w,h -o MASK`"
print(json.dumps({"event": "failed", "message": message, "code": 2}), flush=True)
sys.exit(2)
"""
    script = decompose_steps(
        photo_file(tmp_path),
        None,
        None,
        MethodSettings(),
        ResultDestination(folder),
        0,
        fake_core(tmp_path, code),
    )
    run = WorkerRun("Decompose cup", script, take, folder)
    until(lambda: run.step().state != "running")
    assert (
        run.status.message == "cup: choose a mask image, or make one with Add Point or Select Box"
    )


def test_following_ends_the_worker_when_it_is_closed() -> None:
    class Fake:
        killed = 0

        def poll(self) -> WorkerUpdate:
            return WorkerUpdate("at work", 0.5)

        def kill(self) -> None:
            self.killed += 1

    worker = Fake()
    following = follow_worker(worker)
    next(following)
    following.close()
    assert worker.killed == 1


# --- in the window --------------------------------------------------------------------------------


class Plain(WorkerOperator):
    """The operators' mixin without Blender's class, which cannot be made outside of Blender's own
    call.
    """

    def __init__(self, run: WorkerRun) -> None:
        self._run = run
        self.said: list[tuple[set[str], str]] = []

    def report(self, kind: set[str], text: str) -> None:
        self.said.append((kind, text))


def event(kind: str, value: str = "NOTHING") -> Any:
    return SimpleNamespace(type=kind, value=value)


def test_only_timer_events_poll(addon: Any, folder: Path) -> None:
    run = begin_run(WorkerRun("Decompose cup", script(2, folder), take, folder))
    plain, shown = Plain(run), addon.context.window_manager.isc
    assert (
        plain.modal(addon.context, event("MOUSEMOVE")) == {"PASS_THROUGH"}
        and run.status.stage == "starting"
    )
    assert plain.modal(addon.context, event("TIMER")) == {"PASS_THROUGH"}
    assert (shown.title, shown.state, shown.stage) == ("Decompose cup", "running", "at work")
    states = [plain.modal(addon.context, event("TIMER")) for _ in range(2)]
    assert states == [{"PASS_THROUGH"}, {"FINISHED"}]
    assert (shown.state, shown.message, plain.said) == (
        "done",
        "took run",
        [({"INFO"}, "took run")],
    )
    assert shown.longest_call_ms > 0 and shown.import_ms > 0


def test_escape_cancels_at_once(addon: Any, folder: Path) -> None:
    run = begin_run(WorkerRun("Decompose cup", script(9, folder), take, folder))
    plain = Plain(run)
    plain.modal(addon.context, event("TIMER"))
    assert plain.modal(addon.context, event("ESC", "RELEASE")) == {"PASS_THROUGH"} and not run.ended
    assert plain.modal(addon.context, event("ESC", "PRESS")) == {"CANCELLED"}
    assert addon.context.window_manager.isc.state == "cancelled" and not folder.exists()


def test_the_button_cancels(addon: Any, folder: Path) -> None:
    assert not addon.ops.isc.cancel.poll()
    run = begin_run(WorkerRun("Decompose cup", script(9, folder), take, folder))
    run.step()
    assert addon.ops.isc.cancel() == {"FINISHED"} and run.status.state == "cancelled"
    assert Plain(run).modal(addon.context, event("TIMER")) == {"CANCELLED"}


def test_a_report_is_kept_as_text(addon: Any, folder: Path) -> None:
    for log in ("an older log", "the log's tail"):
        run = begin_run(
            WorkerRun("Decompose cup", failing(WorkerFailed("it died", log)), take, folder)
        )
        plain = Plain(run)
        plain.modal(addon.context, event("TIMER"))
        assert plain.modal(addon.context, event("TIMER")) == {"CANCELLED"}
    assert plain.said == [({"ERROR"}, "It died (see the text ISC Report)")]
    assert [text.name for text in addon.data.texts] == ["ISC Report"]
    assert addon.data.texts[0].as_string().splitlines() == [
        "Decompose cup",
        "it died",
        "",
        "the log's tail",
    ]


@pytest.mark.parametrize("mode", ["EDIT", "SCULPT", "TEXTURE_PAINT", "POSE"])
def test_nothing_is_built_while_something_is_edited(addon: Any, folder: Path, mode: str) -> None:
    """Undo in Edit Mode covers that mode alone: the result would not be one step."""
    if mode == "POSE":
        addon.ops.object.armature_add()
    else:
        addon.ops.mesh.primitive_cube_add()
    addon.ops.object.mode_set(mode=mode)
    run = begin_run(WorkerRun("Decompose cup", script(0, folder), take, folder))
    assert not advance_run(addon.context, run) and not advance_run(addon.context, run)
    assert addon.context.window_manager.isc.stage == "return to Object Mode to import the result"
    addon.ops.object.mode_set(mode="OBJECT")
    assert advance_run(addon.context, run) and run.status.state == "done"


def test_a_script_does_not_wait_for_object_mode(addon: Any, bump_folder: Path) -> None:
    addon.ops.mesh.primitive_cube_add()
    addon.ops.object.mode_set(mode="SCULPT")
    with pytest.raises(RuntimeError, match="Return to Object Mode first"):
        addon.ops.isc.import_result(directory=str(bump_folder))


def test_loading_another_file_ends_the_run(addon: Any, folder: Path) -> None:
    run = begin_run(WorkerRun("Decompose cup", script(9, folder), take, folder))
    run.step()
    addon.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert run.status.state == "cancelled" and not folder.exists()
    assert addon.context.window_manager.isc.state in {"", "cancelled"}


def test_unregistering_ends_the_run(blender: Any, folder: Path) -> None:
    blender_addon.register()
    run = begin_run(WorkerRun("Decompose cup", script(9, folder), take, folder))
    run.step()
    blender_addon.unregister()
    assert run.status.state == "cancelled" and not folder.exists()
    assert not hasattr(blender.types.Scene, "isc") and not hasattr(
        blender.ops.isc.decompose, "nothing"
    )


@pytest.mark.slow
def test_closing_blender_ends_the_worker(tmp_path: Path) -> None:
    """A Blender of its own that is left while a run goes on: neither process nor folder outlives
    it.
    """
    import subprocess

    environment = fake_core(
        tmp_path,
        SLOW.replace(
            "while True",
            f"import os\nopen({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid()))\nwhile True",
        ),
    )
    code = f"""
import atexit, sys, time
from pathlib import Path
import bpy, blender_addon
def unregister_last():
    print("ended:", run.ended, flush=True)
    blender_addon.unregister()  # Blender 4.5 does not exit while an add-on is registered
atexit.register(unregister_last)
blender_addon.register()
from blender_addon.runs.active_run import begin_run
from blender_addon.runs.worker_run import RunOutput, WorkerRun
from blender_addon.runs.request import MethodSettings
from blender_addon.runs.run_steps import ResultDestination, decompose_steps
from blender_addon.files.image_source import ImageSource
from blender_addon.worker.commands import WorkerEnvironment
search, cache = Path({str(environment.search[0])!r}), Path({str(tmp_path / "cache")!r})
environment = WorkerEnvironment(Path(sys.executable), (search,), cache)
folder = Path({str(tmp_path / "run")!r})
folder.mkdir()
picture = ImageSource("cup", path=Path({str(tmp_path / "cup.png")!r}))
place = ResultDestination(folder)
steps = decompose_steps(picture, None, None, MethodSettings(), place, 0, environment)
run = begin_run(WorkerRun("Decompose cup", steps, lambda *_: "", folder))
end = time.monotonic() + 30
while run.step().stage != "solving" or not Path({str(tmp_path / "pid")!r}).exists():
    assert time.monotonic() < end
    time.sleep(0.02)
"""
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert "ended: True" in done.stdout
    assert not (tmp_path / "run").exists()
    until(lambda: has_ended((tmp_path / "pid").read_text()), 60.0)
