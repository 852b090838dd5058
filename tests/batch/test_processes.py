"""Workers that are processes: they die, hang and are cancelled; and the command itself."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import psutil  # type: ignore[import-untyped]
import pytest

from isc_core.batch.attempts import MAX_CRASHES
from isc_core.batch.engine import WorkerOptions
from isc_core.batch.item import DONE, FAILED
from isc_core.batch.run_batch import run_batch
from isc_core.cli.main import main
from tests.batch.conftest import batch, rows
from tests.batch.tasks import obedient
from tests.core.command_line import isc_command, run_isc, through_terminal


def one_worker(inputs: Path, output: Path) -> list[object]:
    """The words of a quick batch with one worker."""
    quick = ["--model", "retinex", "--workers", "1", "--memory", "0"]
    return ["batch", inputs, "-o", output, *quick]


@pytest.mark.slow
def test_images_that_hang_or_kill_their_worker_are_reported_and_the_rest_is_done(
    tmp_path: Path,
) -> None:
    for name in ("good1", "good2", "hang", "kill", "kill_once"):
        (tmp_path / f"{name}.png").touch()
    plan = replace(
        batch(tmp_path / "*.png", output=tmp_path / "out", timeout=4.0),
        worker_options=WorkerOptions(workers=2, threads=1, memory="0"),
    )
    assert run_batch(plan, task=obedient) == Counter({DONE: 3, FAILED: 2})
    reasons = {
        str(row["name"]): str(row["reason"]) for row in rows(tmp_path / "out" / "failures.jsonl")
    }
    assert (
        reasons["hang"]
        == "exceeded --timeout 4 s and did not respond (in obey): its worker was stopped"
    )
    assert reasons["kill"].startswith(f"{MAX_CRASHES} workers crashed while processing it")
    assert (tmp_path / "out" / "kill_once" / "made").exists()


@pytest.mark.slow
def test_the_command_ctrl_c_and_going_on(photos: Path, tmp_path: Path) -> None:
    words = one_worker(photos, tmp_path / "out")
    run = subprocess.Popen(
        isc_command(*words), stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while run.poll() is None and not (tmp_path / "out" / "one").exists():
        time.sleep(0.05)
    os.killpg(run.pid, signal.SIGINT)  # as a terminal does: to all of them
    told = run.communicate(timeout=300)[1]
    assert run.returncode in (130, 1), told  # 1: it was faster
    assert "isc: 4 images" in told
    assert "Traceback" not in told
    done = run_isc(*words)
    assert done.returncode == 1, done.stderr
    assert "1 of 4 results failed" in done.stderr
    assert all((tmp_path / "out" / name / "mesh.glb").is_file() for name in ("one", "two", "three"))


@pytest.mark.slow
def test_notes_and_progress_share_a_terminal(photos: Path, tmp_path: Path) -> None:
    words = ("batch", photos / "bad.png", "-o", tmp_path / "out", "--workers", "1", "--memory", "0")
    text = through_terminal(*isc_command(*words))
    assert "starting workers\r\x1b[Kisc: 1 image\r\n" in text


@pytest.mark.slow
def test_a_worker_that_is_lost_while_it_starts_is_started_again(
    photos: Path, tmp_path: Path
) -> None:
    words = one_worker(photos / "one.png", tmp_path / "out")
    run = psutil.Popen(
        isc_command(*words), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    starting: list[psutil.Process] = []
    while run.poll() is None and not starting:
        with suppress(psutil.Error):  # others come and go
            starting = [
                child
                for child in run.children(recursive=True)
                if "spawn_main" in " ".join(child.cmdline())
            ]
    starting[0].kill()
    printed, told = run.communicate(timeout=300)
    assert "1 result done" in printed, told
    assert (tmp_path / "out" / "one" / "mesh.glb").is_file()


def test_what_is_wrong_with_the_run_is_one_line(
    photos: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Found before any worker starts."""

    def never(*values: object) -> None:
        raise AssertionError("no worker may start")

    monkeypatch.setattr("isc_core.batch.run_batch.connected", never)

    def told(*words: object) -> str:
        assert main(["batch", *map(str, words), "-o", str(tmp_path / "out")]) == 2
        lines = capsys.readouterr().err.splitlines()
        (line,) = (line for line in lines if line != "isc: reading the inputs")
        return line

    assert "none.csv: cannot be read" in told(tmp_path / "none.csv")
    assert 'unknown model "nosuch"' in told(photos, "--model", "nosuch")
    assert "is not above 0" in told(photos, "--timeout", "-1")
    for memory in ("4", "1kB", "-1", "inf", "1e-5"):  # Dask restarted these workers for ever
        assert "needs at least 200MB: give" in told(photos, "--memory", memory)
    assert "--memory 5XB: Could not interpret" in told(photos, "--memory", "5XB")
    monkeypatch.setitem(sys.modules, "dask", None)
    assert "pip install 'dask[distributed]>=" in told(photos)
