"""Workers: real decompositions, and a fake `isc_core` that misbehaves on demand."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_addon.worker.commands import (
    DecomposeJob,
    WorkerEnvironment,
    start_arrays,
    start_box_mask,
    start_decompose,
)
from blender_addon.worker.process import WorkerProcess, WorkerUpdate
from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.io.atomic import remove_unfinished, unfinished
from isc_core.numerics.kernel_library import shipped_library
from isc_core.result_files.result_folder import load, save
from isc_core.separation import HIGHLIGHT_ODDS
from tests.core.ball_scene import ball

ROOT = Path(__file__).resolve().parents[2]
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs signals")

# A package in place of `isc_core`. Its behaviour is in `behave.py` beside it; its last arguments
# are always `--progress json --cancel-at-eof`.
STAND_IN = """
import json, os, sys, time
from pathlib import Path
words = sys.argv[1:]
output = Path(words[words.index("-o") + 1])
partial = output.with_name(f".{output.name}.0a1b2c3d.partial")
def say(event, **content):
    print(json.dumps({"event": event, **content}), flush=True)
def write_half():
    partial.mkdir(parents=True)
    (partial / "maps.exr").write_text("half")
"""
STUBBORN = (
    "write_half()\nsay('progress', stage='asleep', fraction=0.5)\nwhile True: time.sleep(0.05)\n"
)


@pytest.fixture(scope="session")
def bytecode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of Python's byte code for all tests; each test has its own kernels."""
    return tmp_path_factory.mktemp("bytecode")


@pytest.fixture
def cache(tmp_path: Path, bytecode: Path) -> Path:
    """A cache without kernels."""
    (tmp_path / "cache").mkdir()
    with contextlib.suppress(
        OSError
    ):  # not allowed to everybody on Windows, and only slower without
        (tmp_path / "cache" / "bytecode").symlink_to(bytecode, target_is_directory=True)
    return tmp_path / "cache"


@pytest.fixture
def real(cache: Path) -> WorkerEnvironment:
    return WorkerEnvironment(Path(sys.executable), (ROOT,), cache)


@pytest.fixture
def fake_core(tmp_path: Path) -> Callable[[str], WorkerEnvironment]:
    """Makes an environment whose `isc_core` behaves as the given lines say."""

    def make(lines: str) -> WorkerEnvironment:
        package = tmp_path / "fake_core" / "isc_core"
        package.mkdir(parents=True)
        (package / "__init__.py").touch()
        (package / "__main__.py").write_text(STAND_IN + lines)
        return WorkerEnvironment(
            Path(sys.executable), (tmp_path / "fake_core",), tmp_path / "cache"
        )

    return make


def ended(
    worker: WorkerProcess,
    seconds: float = 120.0,
    until: Callable[[WorkerUpdate], bool] = lambda update: update.state != "running",
) -> WorkerUpdate:
    """The first update that meets the condition, by default the worker's end."""
    deadline = time.monotonic() + seconds
    while not until(update := worker.poll()):
        assert time.monotonic() < deadline, update
        time.sleep(0.01)
    return update


def at_stage(worker: WorkerProcess, stage: str) -> None:
    """Waits until the worker is there."""
    assert (
        ended(
            worker, until=lambda update: update.stage.startswith(stage) or update.state != "running"
        ).state
        == "running"
    )


def job(
    photo: Path, output: Path, mask: Path | None = None, model: str = "naive", **changes: Any
) -> DecomposeJob:
    return DecomposeJob(
        photo, output, mask, model, "none", "natural", 64, **{"threads": 1, **changes}
    )


def ball_arrays(folder: Path) -> tuple[Path, Path]:
    """A photo of floats in linear light and its mask."""
    d = ball((60, 70), 24.0, (30, 35))
    np.save(folder / "photo.npy", d.image)
    np.save(folder / "mask.npy", d.mask)
    return folder / "photo.npy", folder / "mask.npy"


def others(folder: Path, *expected: str) -> list[str]:
    """Unexpected entries of a folder."""
    return sorted({entry.name for entry in folder.iterdir()} - {"cache", "fake_core", *expected})


# --- real work ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_arrays_are_decomposed_into_a_result_with_arrays(
    tmp_path: Path, real: WorkerEnvironment
) -> None:
    photo, mask = ball_arrays(tmp_path)
    seen: list[WorkerUpdate] = []
    worker = start_decompose(job(photo, tmp_path / "new" / "result", mask), real)
    final = ended(worker, until=lambda update: seen.append(update) or update.state != "running")  # type: ignore[func-returns-value]
    assert (final.state, final.fraction) == ("done", 1.0), final
    assert final.message == f"see {tmp_path / 'new' / 'result' / 'preview.png'}"
    fractions = [update.fraction for update in seen]
    assert fractions == sorted(fractions)
    assert "starting" in {update.stage for update in seen}
    found = load(tmp_path / "new" / "result")
    assert (
        found.provenance.settings["model"] == "naive" and found.provenance.settings["threads"] == 1
    )
    assert (tmp_path / "new" / "result" / "arrays.npz").is_file()
    assert others(tmp_path, "new", "photo.npy", "mask.npy") == []
    worker.kill()  # does nothing after the end
    worker.cancel()
    assert worker.poll() == final


@pytest.mark.slow
def test_invalid_input_is_reported_in_one_line(tmp_path: Path, real: WorkerEnvironment) -> None:
    final = ended(start_decompose(job(tmp_path / "nowhere.png", tmp_path / "result"), real))
    assert (final.state, final.log) == ("failed", "")
    assert final.message == f"{tmp_path / 'nowhere.png'}: there is no such file"
    assert others(tmp_path) == []


@pytest.mark.slow
def test_masks_and_arrays_are_made_by_workers_too(tmp_path: Path, real: WorkerEnvironment) -> None:
    d = ball((60, 70), 24.0, (30, 35))
    np.save(
        tmp_path / "photo.npy",
        np.rint(255 * linear_to_srgb(np.clip(d.image, 0, 1))).astype(np.uint8),
    )
    save(d, tmp_path / "result")
    final = ended(
        start_box_mask(tmp_path / "photo.npy", (4, 4, 62, 52), tmp_path / "mask.png", real)
    )
    assert final.state == "done" and (tmp_path / "mask.png").is_file(), final
    final = ended(
        start_box_mask(tmp_path / "photo.npy", (-4, 4, 62, 52), tmp_path / "other.png", real)
    )
    assert final.state == "failed" and "-4" in final.message
    assert ended(start_arrays(tmp_path / "result", real)).state == "done"
    assert (tmp_path / "result" / "arrays.npz").is_file()


@pytest.mark.slow
def test_cancelled_while_it_compiles(tmp_path: Path, real: WorkerEnvironment) -> None:
    """With an empty cache the first solve compiles for long: the worker is cancelled midway and
    cleans up.
    """
    if shipped_library() is not None:
        pytest.skip("the kernels were compiled ahead of time")
    photo, mask = ball_arrays(tmp_path)
    worker = start_decompose(job(photo, tmp_path / "new" / "result", mask, "sirfs"), real)
    at_stage(worker, "preparing the compiled kernels")
    worker.cancel()
    assert ended(worker, 30).state == "cancelled"
    assert worker.exit_code in (130, -signal.SIGKILL)
    assert others(tmp_path, "photo.npy", "mask.npy") == []


@pytest.mark.slow
@posix
def test_the_worker_ends_when_its_program_does(tmp_path: Path, cache: Path) -> None:
    """Blender's crash, played by a program that leaves without a word in the midst of the work."""
    photo, mask = ball_arrays(tmp_path)
    program = (
        "import os, sys, time\nfrom pathlib import Path\n"
        "from blender_addon.worker.commands import DecomposeJob, WorkerEnvironment\n"
        "from blender_addon.worker.commands import start_decompose\n"
        "photo, mask, output, cache = map(Path, sys.argv[1:])\n"
        f"environment = WorkerEnvironment(Path(sys.executable), (Path({str(ROOT)!r}),), cache)\n"
        "job = DecomposeJob(photo, output, mask, 'sirfs', 'none', 'natural', 64)\n"
        "worker = start_decompose(job, environment)\n"
        "stages = 'preparing the compiled kernels', 'shape and light'\n"
        "while not worker.poll().stage.startswith(stages): time.sleep(0.01)\n"
        "print(worker.pid, flush=True)\nos._exit(9)\n"
    )
    command = [sys.executable, "-c", program, photo, mask, tmp_path / "new" / "result", cache]
    done = subprocess.run(
        list(map(str, command)), cwd=ROOT, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 9, done.stderr
    wait_for_the_end_of(int(done.stdout))
    assert others(tmp_path, "photo.npy", "mask.npy") == []


def wait_for_the_end_of(pid: int) -> None:
    """Of a process that is nobody's child here."""
    deadline = time.monotonic() + 30
    while Path(f"/proc/{pid}").exists() if Path("/proc").exists() else alive(pid):
        assert time.monotonic() < deadline, "the worker outlives its program"
        time.sleep(0.05)


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.slow
def test_the_core_runs_as_a_part_of_an_extension(tmp_path: Path, cache: Path) -> None:
    """As it is shipped: a folder within the extension's, which alone is on the path, beside the
    packages of the wheels.
    """
    extension = tmp_path / "extension"
    shutil.copytree(
        ROOT / "isc_core", extension / "isc_core", ignore=shutil.ignore_patterns("__pycache__")
    )
    save(ball((40, 50), 16.0, (20, 25)), tmp_path / "result")
    before = set(extension.rglob("*"))
    environment = WorkerEnvironment(
        Path(sys.executable), (extension, Path(sysconfig.get_path("purelib"))), cache
    )
    assert ended(start_arrays(tmp_path / "result", environment)).state == "done"
    assert set(extension.rglob("*")) == before, "nothing is written beside the source"


# --- misbehaviour ---------------------------------------------------------------------------------

Maker = Callable[[str], WorkerEnvironment]


def test_the_environment_is_explicit(
    tmp_path: Path, fake_core: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (
        "PYTHONHOME",
        "PYTHONPATH",
        "LD_PRELOAD",
        "LD_LIBRARY_PATH",
        "OCIO",
        "BLENDER_USER_RESOURCES",
        "NUMBA_NUM_THREADS",
    ):
        monkeypatch.setenv(name, "wrong")
    environment = fake_core(
        "known = [dict(os.environ), sys.path, os.getcwd(), sys.flags.no_user_site]\n"
        "say('done', output='', lines=[json.dumps(known)])"
    )
    final = ended(
        start_decompose(job(tmp_path / "a.png", tmp_path / "out", threads=3), environment)
    )
    variables, path, folder, no_user_site = json.loads(final.message)
    assert "wrong" not in variables.values()
    assert (variables["PYTHONPATH"], variables["NUMBA_CACHE_DIR"]) == (
        str(tmp_path / "fake_core"),
        str(tmp_path / "cache"),
    )
    assert (
        variables["OMP_NUM_THREADS"] == variables["OPENBLAS_NUM_THREADS"] == "3"
        and variables["PATH"] == os.environ["PATH"]
    )
    assert path[0] == str(tmp_path / "fake_core") and folder not in path and no_user_site == 1
    assert "OMP_NUM_THREADS" not in environment.variables()


def test_the_job_reaches_the_command_line(
    tmp_path: Path, fake_core: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    environment = fake_core("say('done', output='', lines=words)")
    asked = DecomposeJob(
        photo=Path("-a.png"),
        output=Path("out"),
        mask=Path("m.png"),
        model="mdr",
        separator="isc",
        illumination="laboratory",
        max_size=300,
        threads=2,
        transfer="linear",
        camera="28",
        texture_size="2048",
        highlight_odds="1",
        highlights=((40, 20), (1, 2)),
        not_highlights=((3, 4),),
        refine=True,
        light_colour="0.9,0.5,0.2",
        cache=Path("kept"),
    )
    *words, last = ended(start_decompose(asked, environment)).message.split("\n")
    assert last == "--cancel-at-eof"
    here = tmp_path.resolve()
    assert words[:5] == ["decompose", str(here / "-a.png"), "--arrays", "-o", str(here / "out")]
    marks = [word for word in words if "highlight=" in word]
    assert marks == ["--highlight=40,20", "--highlight=1,2", "--not-highlight=3,4"]
    words.remove("--refine")
    words = [word for word in words if word not in marks]
    pairs = dict(zip(words[5::2], words[6::2], strict=True))
    assert pairs == {
        "--model": "mdr",
        "--separator": "isc",
        "--illumination": "laboratory",
        "--max-size": "300",
        "--threads": "2",
        "--transfer": "linear",
        "--camera": "28",
        "--texture-size": "2048",
        "--highlight-odds": "1",
        "--light-colour": "0.9,0.5,0.2",
        "--cache": os.path.abspath("kept"),
        "--mask": str(here / "m.png"),
        "--progress": "json",
    }


def test_unless_asked_the_odds_are_those_of_the_command_line() -> None:
    assert float(DecomposeJob.highlight_odds) == HIGHLIGHT_ODDS


@pytest.mark.slow
@posix
@pytest.mark.parametrize("how", ["cancel", "kill"])
def test_an_unresponsive_worker_is_killed_with_its_children(
    tmp_path: Path, fake_core: Maker, how: str
) -> None:
    child = (
        "import subprocess\nchild = subprocess.Popen(['sleep', '300'])\n"
        "print(child.pid, file=sys.stderr, flush=True)\n"
    )
    worker = start_decompose(
        job(tmp_path / "a.png", tmp_path / "new" / "out"), fake_core(child + STUBBORN)
    )
    at_stage(worker, "asleep")
    assert (tmp_path / "new" / ".out.0a1b2c3d.partial" / "maps.exr").is_file()
    assert os.getpriority(os.PRIO_PROCESS, worker.pid) == min(
        os.getpriority(os.PRIO_PROCESS, 0) + 10, 19
    )
    getattr(worker, how)()
    assert worker.poll().state == "running", "nobody has waited"
    final = ended(worker, 20)
    assert (final.state, worker.exit_code) == ("cancelled", -signal.SIGKILL)
    wait_for_the_end_of(int(final.log))
    assert others(tmp_path) == []


def test_a_killed_worker_leaves_completed_results(tmp_path: Path, fake_core: Maker) -> None:
    out = tmp_path / "out"
    (out / ".3.11111111.partial").mkdir(parents=True)
    folders = "(output / '1').mkdir()\n(output / '.2.0a1b2c3d.partial').mkdir()\n"
    worker = start_decompose(job(tmp_path / "a.png", out), fake_core(folders + STUBBORN))
    at_stage(worker, "asleep")
    assert (out / ".2.0a1b2c3d.partial").is_dir()
    worker.kill()
    assert ended(worker, 20).state == "cancelled"
    left = sorted(path.name for path in out.iterdir())
    assert left == [".3.11111111.partial", "1"], "another process may be at work there"


@posix
def test_a_worker_killed_from_outside_has_failed(tmp_path: Path, fake_core: Maker) -> None:
    earlier = tmp_path / ".out.11111111.partial"
    earlier.mkdir()
    worker = start_decompose(
        job(tmp_path / "a.png", tmp_path / "out"),
        fake_core("print('so far so good', file=sys.stderr, flush=True)\n" + STUBBORN),
    )
    at_stage(worker, "asleep")
    os.kill(worker.pid, signal.SIGKILL)
    final = ended(worker, 20)
    assert (final.state, final.fraction, final.log) == ("failed", 0.5, "so far so good")
    assert "killed (SIGKILL)" in final.message and "\n" not in final.message
    assert others(tmp_path) == [earlier.name], "another process may be at work there"


def test_a_crash_is_reported_with_the_end_of_its_log(tmp_path: Path, fake_core: Maker) -> None:
    lines = (
        "write_half()\nprint('x' * 20000, file=sys.stderr)\n"
        "print('not json\\n[1, 2]\\n{\"half\": ')\nraise RuntimeError('out of ink')"
    )
    final = ended(start_decompose(job(tmp_path / "a.png", tmp_path / "out"), fake_core(lines)))
    assert final.state == "failed"
    assert final.message == "the worker ended unexpectedly (exit code 1): RuntimeError: out of ink"
    assert "Traceback" in final.log and len(final.log) <= 8000
    assert others(tmp_path) == []


def test_a_worker_without_output_has_failed(tmp_path: Path, fake_core: Maker) -> None:
    final = ended(start_decompose(job(tmp_path / "a.png", tmp_path / "out"), fake_core("")))
    assert (final.state, final.message) == (
        "failed",
        "the worker ended unexpectedly (exit code 0): no error message",
    )


def test_a_missing_interpreter_is_reported_in_one_line(tmp_path: Path) -> None:
    away = WorkerEnvironment(tmp_path / "no-python", (ROOT,), tmp_path / "cache")
    with pytest.raises(InputError, match="no-python .*install the extension again") as caught:
        start_decompose(job(tmp_path / "a.png", tmp_path / "out"), away)
    assert "\n" not in str(caught.value)


def test_a_missing_core_is_reported(tmp_path: Path) -> None:
    base = Path(
        getattr(sys, "_base_executable", sys.executable)
    )  # without the packages of the environment that the tests run in
    if (
        subprocess.run(
            [base, "-c", "import isc_core"], cwd=tmp_path, capture_output=True, check=False
        ).returncode
        == 0
    ):
        pytest.skip("isc_core is installed for every program of this machine")
    final = ended(
        start_decompose(
            job(tmp_path / "a.png", tmp_path / "out"),
            WorkerEnvironment(base, (tmp_path,), tmp_path / "cache"),
        )
    )
    assert (
        final.state == "failed"
        and "No module named isc_core" in final.message
        and "\n" not in final.message
    )


@posix
@pytest.mark.parametrize("end", ["worker.kill()", "atexit.register(worker.kill)"])
def test_a_program_that_kills_and_exits_at_once_leaves_nothing(
    end: str, tmp_path: Path, fake_core: Maker
) -> None:
    """Also if the kill is part of the exit, when Python waits for no thread any more."""
    environment = fake_core(STUBBORN)
    program = (
        "import atexit, sys, time\nfrom pathlib import Path\n"
        "from blender_addon.worker.commands import DecomposeJob, WorkerEnvironment\n"
        "from blender_addon.worker.commands import start_decompose\n"
        "search, cache, output = map(Path, sys.argv[1:])\n"
        "environment = WorkerEnvironment(Path(sys.executable), (search,), cache)\n"
        "worker = start_decompose(DecomposeJob(output, output, None, '', '', '', 0), environment)\n"
        "while worker.poll().stage != 'asleep': time.sleep(0.01)\n"
        f"{end}\n"
    )
    command = [
        sys.executable,
        "-c",
        program,
        environment.search[0],
        environment.cache,
        tmp_path / "new" / "out",
    ]
    done = subprocess.run(
        list(map(str, command)), cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert others(tmp_path) == []


def test_an_earlier_result_is_restored_after_a_kill(tmp_path: Path) -> None:
    """A process killed between the two renames that replace a folder."""
    target = tmp_path / "out"
    (tmp_path / ".out.0000aaaa.old").mkdir()
    (tmp_path / ".out.0000aaaa.old" / "kept").touch()
    (tmp_path / ".out.0000bbbb.partial").touch()
    (tmp_path / ".out.txt.0000bbbb.partial").touch()
    (tmp_path / ".out.0000bbbb.partial.txt").touch()
    assert {path.name for path in unfinished(target)} == {
        ".out.0000aaaa.old",
        ".out.0000bbbb.partial",
    }
    remove_unfinished(target)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        ".out.0000bbbb.partial.txt",
        ".out.txt.0000bbbb.partial",
        "out",
    ]
    assert (target / "kept").exists()
    (tmp_path / ".out.0000cccc.old").mkdir()
    remove_unfinished(target)
    assert not unfinished(target) and (target / "kept").exists()
    assert unfinished(tmp_path / "nowhere" / "out") == frozenset()
