"""The start of the command: what it imports, and Ctrl-C before the work begins."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isc_core.cli.commands import build_parser
from isc_core.cli.commands.registry import CORE, all_commands
from isc_core.cli.interface.parser import actions_of
from tests.core.command_line import ROOT, ball_codes, ball_photo, isc_command

NUMERICAL = {"numpy", "scipy", "numba", "cv2", "OpenEXR", "trimesh", "PIL", "mitsuba", "matplotlib"}
_INTERRUPTS = 15  # over a run


def loaded(*arguments: str) -> set[str]:
    """The modules in memory after `isc ARGUMENTS`."""
    code = (
        "import sys; from isc_core.cli.main import main\n"
        f"main({list(arguments)!r})\n"
        "print('\\n' + ' '.join(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("arguments", [("--help",), ("--version",)])
def test_the_help_imports_no_command(arguments: tuple[str, ...]) -> None:
    modules = loaded(*arguments)
    assert not modules & NUMERICAL
    commands = {entry.module for entry in all_commands()}
    assert not modules & commands


@pytest.mark.slow
def test_a_command_imports_no_other_command() -> None:
    modules = loaded("mask", "--help")
    others = {entry.module for entry in CORE if entry.name != "mask"}
    assert not modules & others


def test_decompose_loads_its_compiler_while_it_works() -> None:
    """Numba takes longer to import than a photo to read; OpenCV is for masks that are drawn."""
    modules = loaded("decompose", "--help")
    assert "isc_core.decomposition.pipeline" in modules
    assert not modules & {"numba", "llvmlite", "cv2"}


def test_a_plain_photo_loads_nothing_that_other_photos_need(tmp_path: Path) -> None:
    """Decoders of other files, the search for masks, other commands."""
    photo = ball_photo(tmp_path)
    modules = loaded("decompose", str(photo), "-o", str(tmp_path / "result"), "--quiet")
    assert "isc_core.result_files.result_folder" in modules
    assert not modules & {
        *("scipy", "cv2", "matplotlib", "trimesh"),
        *("PIL.ImageCms", "PIL.BmpImagePlugin", "PIL.JpegImagePlugin", "PIL.TiffImagePlugin"),
        *("isc_core.masking.search", "isc_core.networks.mask_network"),
    }
    decoders = {name for name in modules if name.startswith("isc_core.io.decoders.")}
    assert not {name.rpartition(".")[2] for name in decoders} & {"jpeg", "tiff", "exr", "avif"}
    packages = {name.split(".")[1] for name in modules if name.startswith("isc_core.")}
    assert not packages & {"batch", "datasets", "editing", "evaluation", "refinement"}


def test_a_photo_whose_mask_is_searched_loads_no_scipy(tmp_path: Path) -> None:
    codes = (ball_codes() >> 8).astype(np.uint8)
    y, x = np.indices(codes.shape[:2])
    table = np.stack([90 + y, 80 + x, 140 - y], axis=2).astype(np.uint8)
    Image.fromarray(np.where(codes.any(axis=2)[..., None], codes, table)).save(
        tmp_path / "ball.jpg"
    )
    given = str(tmp_path / "ball.jpg"), "--box", "3,3,46,46"
    modules = loaded("decompose", *given, "-o", str(tmp_path / "result"), "--quiet")
    assert {"isc_core.masking.search", "isc_core.numerics.maximum_flow"} <= modules
    assert "scipy" not in modules


def test_a_command_of_the_core_does_not_search_other_packages() -> None:
    """The search among installed packages takes a tenth of a second."""
    code = (
        "import importlib.metadata as m\n"
        "def forbidden(**what): raise AssertionError\n"
        "m.entry_points = forbidden\n"
        "from isc_core.cli.commands import build_parser; build_parser(['mask', '--help'])"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_every_command_has_the_general_options_and_the_exit_codes() -> None:
    commands = dict(actions_of(build_parser()))
    assert set(commands) == {entry.name for entry in all_commands()}
    for entry in all_commands():
        text = commands[entry.name].format_help()
        for words in ("-q, --quiet", "-v, --verbose", "--progress", "--config", "exit codes: 0"):
            assert words in text, (entry.name, words)


def test_the_help_of_decompose_has_a_line_for_each_model_and_method() -> None:
    from isc_core.decomposition.settings import MODELS
    from isc_core.separation import METHODS

    text = dict(actions_of(build_parser(["decompose"])))["decompose"].format_help()
    assert text.index("main options:") < text.index("model:") < text.index("known inputs:")
    for name in (*MODELS, *METHODS):
        assert re.search(rf"^  {name} +\S", text, re.MULTILINE), name


# --- Ctrl-C ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def unguarded() -> float:
    """Seconds of the interpreter's own start, which no program can guard, on a busy machine."""
    start = time.monotonic()
    subprocess.run([sys.executable, "-c", ""], check=True)
    return max(0.1, 2 * (time.monotonic() - start))


def interrupted(command: list[str], seconds: float) -> tuple[int, str]:
    """Exit code and standard error of a process that gets SIGINT after some time."""
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    return process.returncode, errors


@pytest.mark.parametrize(
    "share",
    [0.1, 0.5, *(pytest.param(share, marks=pytest.mark.slow) for share in (0.3, 0.7, 0.9))],
)
def test_an_interrupt_while_libraries_load_is_never_lost(
    tmp_path: Path, unguarded: float, share: float
) -> None:
    """At shares of the time of a run that only starts: nothing is written, the code is 130."""
    photo, output = ball_photo(tmp_path), tmp_path / "out"
    command = isc_command("decompose", photo, "--model", "naive", "-o", output)
    start = time.monotonic()
    subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    lasted = time.monotonic() - start
    shutil.rmtree(output)
    code, errors = interrupted(command, max(unguarded, share * lasted))
    if code == 0:  # the machine was faster this time
        assert output.is_dir()
        return
    assert (code, "Traceback" in errors) == (130, False), errors
    assert errors.splitlines()[-1] == "isc: cancelled"
    assert [path.name for path in tmp_path.iterdir() if path != output] == [photo.name]


@pytest.mark.slow
def test_interrupts_at_any_moment_of_a_run_leave_nothing(tmp_path: Path, unguarded: float) -> None:
    photo, output = ball_photo(tmp_path), tmp_path / "out"
    command = isc_command("decompose", photo, "--max-size", "32", "-o", output)
    start = time.monotonic()
    subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    lasted = time.monotonic() - start
    for step in range(_INTERRUPTS):
        shutil.rmtree(output, ignore_errors=True)
        code, errors = interrupted(command, unguarded + step / _INTERRUPTS * (lasted - unguarded))
        assert "Traceback" not in errors, errors
        assert code == 130 or (code == 0 and output.is_dir()), (step, code, errors)
        left = {path.name for path in tmp_path.iterdir()} - {photo.name}
        assert left <= {"out"}, left


SWALLOW = """
import sys, types
class Greedy:
    def find_spec(self, name, path=None, target=None):
        if name == "isc_core.photo.grabcut" and not self.done:
            self.done = True
            import os, signal
            try:
                os.kill(os.getpid(), signal.SIGINT)
                for _ in range(10**6): pass
            except BaseException as error:
                raise ImportError("wrapped") from error
    done = False
sys.meta_path.insert(0, Greedy())
"""


@pytest.mark.slow
def test_a_library_that_swallows_the_interrupt_does_not_keep_it(tmp_path: Path) -> None:
    """Some libraries catch everything that is raised while they import others."""
    command = isc_command(
        "mask", "photo.png", "--box", "1,1,9,9", "-o", tmp_path / "m.png", before=SWALLOW
    )
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "isc: cancelled\n")


def test_the_handler_is_installed_before_anything_is_imported() -> None:
    code = (
        "import sys\n"
        "class Stop:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'isc_core.cli':\n"
        "            import os, signal; os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Stop())\n"
        "from isc_core.__main__ import start; start()"
    )
    for words, out, err in (
        ([], "", "isc: cancelled\n"),
        (["--progress=json"], '{"event": "cancelled"}\n', ""),
    ):
        done = subprocess.run(
            [sys.executable, "-c", code, *words],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stdout, done.stderr) == (130, out, err)


# --- colours --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("variables", "coloured"),
    [({}, False), ({"FORCE_COLOR": "1"}, True), ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, False)],
)
def test_errors_have_colour_if_enabled(variables: dict[str, str], coloured: bool) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    done = subprocess.run(
        isc_command("separate", "no-such.png", "-o", "out"),
        cwd=ROOT,
        env={**environment, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert ("\x1b[" in done.stderr) == coloured
