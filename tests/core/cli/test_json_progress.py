"""`isc --progress json`: the events that a program receives, and how it cancels the work."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from isc_core.cli.interface.json_progress import JsonReporter
from isc_core.result_files.result_folder import load, save
from tests.core.ball_scene import ball
from tests.core.command_line import ROOT, ball_photo, isc_command

Event = dict[str, Any]
Process = subprocess.Popen[str]
SLEEPY = """import time, isc_core.cli.commands.mask as m
def run(options, monitor):
    monitor.report("sleeping", 0.5)
    return [str(time.sleep(0.01)) for _ in range(6000)]
m.run = run
"""
STUBBORN = """import time, isc_core.cli.commands.mask as m
import isc_core.cli.interface.json_progress as j
j.GRACE_SECONDS = (0.2, 0.2)
def run(options, monitor):
    monitor.report("sleeping", 0.5)
    while True:
        try:
            time.sleep(0.01)
        except KeyboardInterrupt:
            pass
m.run = run
"""


def started(*arguments: object, before: str = "") -> Process:
    """The command, as a program starts it."""
    pipe = subprocess.PIPE
    command = isc_command(*arguments, "--progress", "json", before=before)
    return subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe, text=True)


def followed(
    process: Process, react: Callable[[Event, Process], None] = lambda event, process: None
) -> tuple[int, list[Event], str]:
    """Exit code, events and standard error; `react` is called with each event."""
    assert process.stdout is not None and process.stderr is not None and process.stdin is not None
    with process:
        events = []
        for line in process.stdout:
            events.append(json.loads(line))
            react(events[-1], process)
        errors = process.stderr.read()
        return process.wait(timeout=60), events, errors


def cancel(process: Process) -> None:
    assert process.stdin is not None
    process.stdin.write("cancel\n")
    process.stdin.flush()


def disappear(process: Process) -> None:
    assert process.stdin is not None
    process.stdin.close()


def stages(events: list[Event]) -> list[str]:
    return list(dict.fromkeys(event["stage"] for event in events if event["event"] == "progress"))


def test_a_run_is_reported_from_start_to_end(tmp_path: Path) -> None:
    output = tmp_path / "out"
    code, events, errors = followed(
        started("decompose", ball_photo(tmp_path), "--model", "naive", "--arrays", "-o", output)
    )
    assert (code, errors) == (0, "")
    assert stages(events)[0] == "starting" and {"preparing", "writing arrays"} < set(stages(events))
    fractions = [event["fraction"] for event in events[:-1]]
    assert fractions == sorted(fractions) and fractions[0] == 0 and fractions[-1] == 1
    assert events[-1] == {
        "event": "done",
        "output": str(output),
        "lines": [f"see {output / 'preview.png'}"],
    }
    load(output)


@pytest.mark.slow
@pytest.mark.parametrize("words", [["nowhere.png"], ["nowhere.png", "--no-such-option"]])
def test_invalid_input_is_the_last_event(tmp_path: Path, words: list[str]) -> None:
    code, events, errors = followed(started("separate", *words, "-o", tmp_path / "out"))
    assert (code, errors) == (2, "")
    assert [event["event"] for event in events] == ["progress", "failed"] and events[-1][
        "code"
    ] == 2
    assert "\n" not in events[-1]["message"] and words[-1] in events[-1]["message"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_other_commands_report_json_too(tmp_path: Path) -> None:
    photo = ball_photo(tmp_path)
    save(ball((40, 50), 16.0, (20, 25)), tmp_path / "result")
    for words in (
        ["mask", photo, "--box", "3,3,45,45", "-o", tmp_path / "mask.png"],
        ["separate", photo, "--method", "none", "-o", tmp_path / "layers"],
        ["edit", tmp_path / "result", "recolour", "--hue", "90", "-o", tmp_path / "edit"],
        ["arrays", tmp_path / "result"],
    ):
        code, events, _ = followed(started(*words))
        assert (code, events[-1]["event"], events[-1]["output"]) == (0, "done", str(words[-1])), (
            words
        )
        assert Path(events[-1]["output"]).exists()
    assert "progress" not in json.loads((tmp_path / "edit" / "edit.json").read_text())["parameters"]


def at(stage: str, stop: Callable[[Process], None]) -> Callable[[Event, Process], None]:
    """Reacts to the first event of a stage."""
    seen: list[Event] = []

    def react(event: Event, process: Process) -> None:
        if event.get("stage") == stage and not seen:
            seen.append(event)
            stop(process)

    return react


@pytest.mark.slow
@pytest.mark.parametrize("stop", [cancel, disappear])
def test_a_cancelled_solve_leaves_nothing(tmp_path: Path, stop: Callable[[Process], None]) -> None:
    process = started(
        "decompose",
        ball_photo(tmp_path, 110.0),
        "--engine",
        "numpy",
        "-o",
        tmp_path / "new" / "out",
        "--cancel-at-eof",
    )
    code, events, errors = followed(process, at("shape and light", stop))
    assert (code, events[-1], errors) == (130, {"event": "cancelled"}, "")
    assert [entry.name for entry in tmp_path.iterdir()] == ["ball.png"]


def test_a_start_can_be_cancelled(tmp_path: Path) -> None:
    """The answer to the very first line, while libraries are loaded."""
    process = started("separate", tmp_path / "photo.png", "-o", tmp_path / "out")
    code, events, errors = followed(process, at("starting", cancel))
    assert (code, events[-1], errors) == (130, {"event": "cancelled"}, "")


@pytest.mark.slow
@pytest.mark.parametrize("ignored", [False, True])
def test_work_that_does_not_listen_is_interrupted(tmp_path: Path, ignored: bool) -> None:
    """Also where the program inherits that Ctrl-C is ignored."""
    before = SLEEPY + (
        "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)" if ignored else ""
    )
    process = started(
        "mask", "photo.png", "--box", "1,1,9,9", "-o", tmp_path / "mask.png", before=before
    )
    code, events, errors = followed(process, at("sleeping", cancel))
    assert (code, events[-1], errors) == (130, {"event": "cancelled"}, "")


@pytest.mark.slow
def test_work_that_cannot_be_interrupted_ends_with_its_program(tmp_path: Path) -> None:
    process = started(
        "mask",
        "photo.png",
        "--box",
        "1,1,9,9",
        "-o",
        tmp_path / "mask.png",
        "--cancel-at-eof",
        before=STUBBORN,
    )
    code, events, _ = followed(process, at("sleeping", disappear))
    assert (code, events[-1]["event"]) == (130, "progress")


@pytest.mark.slow
def test_a_command_without_input_runs_on(tmp_path: Path) -> None:
    """Cron and CI give an empty standard input: its end does not cancel."""
    words = ("separate", ball_photo(tmp_path), "--method", "none", "-o", tmp_path / "out")
    done = subprocess.run(
        isc_command(*words, "--progress", "json"),
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout.splitlines()[-1])["event"] == "done"


@pytest.mark.slow
def test_words_that_are_not_the_word_mean_nothing(tmp_path: Path) -> None:
    process = started("separate", ball_photo(tmp_path), "--method", "none", "-o", tmp_path / "out")
    assert process.stdin is not None
    process.stdin.write("hello\n\ncancelled\n")
    process.stdin.flush()
    assert followed(process)[1][-1]["event"] == "done"


@pytest.mark.slow
def test_a_listener_that_goes_deaf_does_not_stop_the_work(tmp_path: Path) -> None:
    process = started("separate", ball_photo(tmp_path), "--method", "none", "-o", tmp_path / "out")
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    with process:
        assert process.wait(timeout=60) == 0
        assert process.stderr.read() == ""
    assert (tmp_path / "out" / "preview.png").exists()


def test_what_breaks_bounds_is_a_failure_with_its_lines(capsys: pytest.CaptureFixture[str]) -> None:
    speaker = JsonReporter(sys.stdout)
    speaker.rejected(["one", "two"], 1)
    assert json.loads(capsys.readouterr().out) == {
        "event": "failed",
        "message": "one; two",
        "code": 1,
    }
