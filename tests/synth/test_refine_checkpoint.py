"""An interrupted `isc refine` is continued by the same command, with the same bytes at the end."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from isc_core.errors import Cancelled
from isc_core.progress import Monitor, ProgressEvent
from isc_core.result_files.result_folder import save
from isc_core.scene.decomposition import Decomposition
from synth.refine.transport import light_transport
from tests.core.command_line import ROOT, isc_command, run_isc
from tests.core.refinement.test_gloss import glossy
from tests.synth.refine_command import command

_REPORTS = 100  # of a run until it is interrupted; no stage has as many
CONTINUED = "continued an interrupted run"


def cancelled_after(reports: int, stage: str = "") -> Monitor:
    """A monitor that cancels the work after that many reports, of one stage or of all."""
    left = [reports]

    def progress(event: ProgressEvent) -> None:
        left[0] -= event.stage == stage or not stage

    return Monitor(progress, lambda: left[0] <= 0)


def interrupt(words: list[str], reports: int = _REPORTS, stage: str = "") -> None:
    """Run the command until it is cancelled."""
    with pytest.raises(Cancelled) as cancellation:
        command(words, cancelled_after(reports, stage))
    (note,) = cancellation.value.__notes__
    assert "repeat the command to continue" in note


def contents(folder: Path) -> dict[str, bytes]:
    """The bytes of all files."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def checkpoint(output: Path) -> Path:
    return output.with_name(f".{output.name}.checkpoint")


def contrasted(size: int = 64) -> Decomposition:
    """A result whose gloss is refined, and whose image has more contrast than its light."""
    d = glossy(size)
    factor = np.exp(d.normal[..., :1])
    diffuse = np.where(d.mask[..., None], d.diffuse * factor, 0).astype(np.float32)
    return replace(
        d, image=diffuse + d.specular, diffuse=diffuse, reflectance=d.reflectance * factor
    )


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a result, `start`, and what a refinement without interruption writes."""
    folder = tmp_path_factory.mktemp("results")
    save(contrasted(), folder / "start")
    assert "gloss refined" in command([str(folder / "start"), "-o", str(folder / "gloss")])[0]
    assert {path.name for path in folder.iterdir()} == {"start", "gloss"}
    return folder


@pytest.mark.slow
def test_gloss_is_continued_wherever_it_was_interrupted(results: Path, tmp_path: Path) -> None:
    before, output, interruptions = contents(results / "start"), tmp_path / "out", 0
    words, lines = [str(results / "start"), "-o", str(output)], list[str]()
    while not lines and interruptions < 20:
        try:
            lines = command(words, cancelled_after(_REPORTS))
        except Cancelled:
            interruptions += 1
            assert [path.name for path in tmp_path.iterdir()] == [".out.checkpoint"]
    assert interruptions >= 3 and CONTINUED in lines and not any("note" in one for one in lines)
    assert contents(output) == contents(results / "gloss")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert contents(results / "start") == before


@pytest.mark.slow
def test_light_is_continued_wherever_it_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mitsuba")
    monkeypatch.setattr("isc_core.refinement.working_scale.LONGEST", 80)  # pixels are traced, too
    monkeypatch.setattr("synth.refine.refine._PIXELS", 3000)
    save(contrasted(160), tmp_path / "start")
    words = [str(tmp_path / "start"), "--light", "-o"]
    whole = command([*words, str(tmp_path / "whole")])
    assert "gloss refined" in whole[0] and "light was refined" in whole[1]
    output = tmp_path / "out"
    for stage, reports in (
        ("tracing shadows", 5),
        ("fitting the light", 20),
        ("rendering the light", 3),
        ("writing maps", 1),
    ):
        interrupt([*words, str(output)], reports, stage)
        assert not output.exists()
    traced = Mock(side_effect=light_transport)
    monkeypatch.setattr("synth.refine.refine.light_transport", traced)
    lines = command([*words, str(output)])
    assert lines[:3] == [*whole[:2], CONTINUED] and not traced.called
    assert contents(output) == contents(tmp_path / "whole")
    assert {path.name for path in tmp_path.iterdir()} == {"start", "out", "whole"}


@pytest.mark.slow
def test_a_killed_run_is_continued(results: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    words = [str(results / "start"), "-o", str(output)]
    code = (
        "import os, signal\n"
        "from isc_core.progress import Monitor\n"
        "from tests.synth.refine_command import command\n"
        f"left = [{_REPORTS}]\n"
        "def progress(event):\n"
        "    left[0] -= 1\n"
        "    if not left[0]:\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        f"command({words!r}, Monitor(progress))\n"
    )
    killed = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False)
    assert killed.returncode == -signal.SIGKILL
    assert [path.name for path in tmp_path.iterdir()] == [".out.checkpoint"]
    assert CONTINUED in command(words)
    assert contents(output) == contents(results / "gloss")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def require_continued(words: list[str], results: Path, output: Path) -> None:
    """Check that nothing but stages was left beside the output, and that the run continues."""
    assert [path.name for path in output.parent.iterdir()] == [".out.checkpoint"]
    stages = list(checkpoint(output).iterdir())
    assert stages and all(path.suffix == ".npz" for path in stages)
    lines = command(words)
    assert CONTINUED in lines and not any("note" in line for line in lines)
    assert contents(output) == contents(results / "gloss")
    assert [path.name for path in output.parent.iterdir()] == ["out"]


@pytest.mark.slow
def test_a_run_that_a_batch_system_ends_is_continued(results: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    words = [str(results / "start"), "-o", str(output)]
    with subprocess.Popen(
        isc_command("refine", *words), cwd=ROOT, stderr=subprocess.PIPE, text=True
    ) as process:
        while process.poll() is None and not list(checkpoint(output).glob("*.npz")):
            time.sleep(0.01)
        process.terminate()
        error = process.communicate(timeout=60)[1]
    assert process.returncode == 143 and "Traceback" not in error, error
    require_continued(words, results, output)


@pytest.mark.slow
def test_sigterm_while_the_output_is_written_leaves_the_stages(
    results: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out"
    words = [str(results / "start"), "-o", str(output)]
    before = (
        "import os, signal\n"
        "from isc_core.progress import Monitor\n"
        "report = Monitor.report\n"
        "def ending(self, stage, *rest):\n"
        "    report(self, stage, *rest)\n"
        "    if stage == 'building the mesh':\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "Monitor.report = ending"
    )
    ended = run_isc("refine", *words, before=before)
    assert ended.returncode == 143 and "Traceback" not in ended.stderr, ended.stderr
    require_continued(words, results, output)


@pytest.mark.slow
def test_a_stage_that_is_cut_short_is_computed_again(results: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    words = [str(results / "start"), "-o", str(output)]
    interrupt(words)
    (file,) = checkpoint(output).iterdir()
    file.write_bytes(file.read_bytes()[:-100])
    lines = command(words)
    assert lines[1].startswith("note: 1 kept stage was not used: damaged, or of another")
    assert contents(output) == contents(results / "gloss")
    assert not checkpoint(output).exists()


@pytest.mark.slow
def test_stages_of_another_result_or_seed_are_not_used(results: Path, tmp_path: Path) -> None:
    output, other = tmp_path / "out", tmp_path / "other"
    d = contrasted()
    save(replace(d, specular=d.specular * np.float32(1.1)), other)
    interrupt([str(other), "-o", str(output)])
    interrupt([str(results / "start"), "--seed", "1", "-o", str(output)])
    lines = command([str(results / "start"), "-o", str(output)])
    assert lines[1].startswith("note: 2 kept stages were not used")
    assert contents(output) == contents(results / "gloss")
    assert not checkpoint(output).exists()


@pytest.mark.slow
def test_where_nothing_can_be_kept_the_run_ends_the_same(results: Path, tmp_path: Path) -> None:
    """A file has the name of the folder, as on a disk that cannot be written."""
    output = tmp_path / "out"
    checkpoint(output).write_bytes(b"mine")
    with pytest.raises(Cancelled) as cancellation:
        command([str(results / "start"), "-o", str(output)], cancelled_after(_REPORTS))
    assert not hasattr(cancellation.value, "__notes__")
    command([str(results / "start"), "-o", str(output)])
    assert contents(output) == contents(results / "gloss")
    assert checkpoint(output).read_bytes() == b"mine"
