"""Photos and results become .blend files and renders: the command, run as users run it, in
processes of their own.
"""

import importlib.util
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from blender_addon.headless import main
from isc_core.cli.interface.interrupts import Interrupts
from isc_core.result_files.diagnostics_text import status_lines
from tests.addon.scene_fixture import bump, write_result
from tests.core.lit_balls import under_lights

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("bpy") is None,
    reason="needs the extra `blender` (Python 3.11 or 3.13)",
)

# Runs a script as Blender's -P does: under the name __main__, with Blender's own arguments before
# `--`, the script's folder not on the search path, and the project not installed.
AS_BLENDER_DOES = """
import runpy, sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]
script = sys.argv[1]
sys.argv = ["blender", "-b", "-P", script, "--", *sys.argv[2:]]
runpy.run_path(script, run_name="__main__")
"""
SCENES = """
import bpy, json, sys
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
about = {
    s.name: [s.render.engine, s.cycles.samples, s.render.resolution_x, len(s.objects)]
    for s in bpy.data.scenes
}
loose = [i.name for i in bpy.data.images if i.size[0] and not i.packed_file]
print("ABOUT", json.dumps([about, bpy.context.scene.name, loose]))
"""


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "blender_addon.headless", *map(str, arguments)]


def run(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    given = {
        "cwd": ROOT,
        "capture_output": True,
        "text": True,
        "check": False,
        "timeout": 300,
    } | options
    return subprocess.run(command(*arguments), **given)  # type: ignore[call-overload]


def scenes_of(blend: Path) -> tuple[dict[str, list[object]], str, list[str]]:
    """The file's scenes, the one it opens with, and images that it does not hold."""
    done = subprocess.run(
        [sys.executable, "-c", SCENES, str(blend)],
        capture_output=True,
        text=True,
        check=True,
        timeout=100,
    )
    line = next(line for line in done.stdout.splitlines() if line.startswith("ABOUT "))
    scenes, active, loose = json.loads(line.removeprefix("ABOUT "))
    return scenes, active, loose


def linear_picture(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """A 16-bit PNG as linear colour, (H, W, 3), and alpha, (H, W)."""
    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., [2, 1, 0, 3]].astype(float) / 65535
    coded = pixels[..., :3]
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4), pixels[
        ..., 3
    ]


def photo(folder: Path, name: str = "bump.png") -> Path:
    """A small photo with an alpha channel."""
    d = bump(48, 64, (20.0, 28.0))
    coded = np.where(
        d.image <= 0.0031308,
        12.92 * d.image,
        1.055 * np.maximum(d.image, 1e-6) ** (1 / 2.4) - 0.055,
    )
    pixels = np.dstack([coded[..., ::-1], d.mask])
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / name), np.rint(65535 * np.clip(pixels, 0, 1)).astype(np.uint16))
    return folder / name


def test_a_result_becomes_a_blend_file_and_a_matching_render(tmp_path: Path) -> None:
    write_result(tmp_path / "result")
    blend, picture = tmp_path / "scene" / "out.blend", tmp_path / "scene" / "out.png"
    done = run(
        tmp_path / "result", "-o", blend, "--render", picture, "--samples", 32, "--specular", "none"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    stages = [line for line in done.stderr.splitlines() if line.endswith("ing result")]
    assert stages == ["isc: building result", "isc: rendering result"]
    scenes, active, loose = scenes_of(blend)
    assert scenes == {"result": ["CYCLES", 32, 88, 2]}, "the object's own scene, and no other"
    assert (active, loose) == ("result", [])
    known = bump()
    got, alpha = linear_picture(picture)
    assert alpha.shape == known.mask.shape
    overlap = ((alpha > 0.5) & known.mask).sum() / ((alpha > 0.5) | known.mask).sum()
    assert overlap > 0.95, "the camera does not frame the object as the photo does"
    inner = cv2.erode(known.mask.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    np.testing.assert_allclose(got[inner].mean(0), known.diffuse[inner].mean(0), rtol=0.05)
    assert sorted(path.name for path in (tmp_path / "scene").iterdir()) == ["out.blend", "out.png"]


@pytest.mark.slow
def test_a_folder_becomes_one_file_with_several_scenes_or_several_files(
    tmp_path: Path,
) -> None:
    for name in ("cup", "jug"):
        write_result(tmp_path / "all" / name)
    done = run(
        tmp_path / "all",
        "-o",
        tmp_path / "all.blend",
        "--render",
        tmp_path / "renders",
        "--samples",
        1,
    )
    assert done.returncode == 0, done.stderr
    assert set(scenes_of(tmp_path / "all.blend")[0]) == {"cup", "jug"}
    assert sorted(path.name for path in (tmp_path / "renders").iterdir()) == ["cup.png", "jug.png"]
    done = run(tmp_path / "all", "-o", tmp_path / "files")
    assert done.returncode == 0, done.stderr
    assert [set(scenes_of(tmp_path / "files" / f"{name}.blend")[0]) for name in ("cup", "jug")] == [
        {"cup"},
        {"jug"},
    ]


@pytest.mark.slow
def test_several_photos_become_several_scenes_of_one_file(tmp_path: Path) -> None:
    for name in ("cup", "jug"):
        photo(tmp_path / "photos", f"{name}.png")
    words = ["--model", "retinex", "--max-size", "32", "--threads", "1"]
    done = run(tmp_path / "photos", "-o", tmp_path / "all.blend", *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert set(scenes_of(tmp_path / "all.blend")[0]) == {"cup", "jug"}


@pytest.mark.slow
def test_each_object_of_a_photo_is_built_in_one_scene(tmp_path: Path) -> None:
    single = cv2.imread(str(photo(tmp_path)), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(tmp_path / "pair.png"), np.concatenate([single, single], axis=1))
    blend, kept = tmp_path / "pair.blend", tmp_path / "kept"
    words = ["--each", "--model", "retinex", "--max-size", "64", "--threads", "1"]
    done = run(tmp_path / "pair.png", "-o", blend, "--results", kept, *words)
    assert done.returncode == 0, done.stdout + done.stderr
    scenes, active, loose = scenes_of(blend)
    assert scenes == {"pair": ["CYCLES", 64, 128, 3]}, "two objects and one camera"
    assert (active, loose) == ("pair", [])
    assert sorted(path.name for path in (kept / "pair").iterdir()) == ["1", "2"]


@pytest.mark.slow
def test_an_object_that_fails_leaves_the_others(tmp_path: Path) -> None:
    single = cv2.imread(str(photo(tmp_path)), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(tmp_path / "pair.png"), np.concatenate([single, single], axis=1))
    blend, kept = tmp_path / "pair.blend", tmp_path / "kept"
    (kept / "pair" / "1").mkdir(parents=True)
    (kept / "pair" / "1" / "diary.txt").write_text("mine")
    words = ["--each", "--model", "retinex", "--max-size", "32", "--threads", "1"]
    done = run(tmp_path / "pair.png", "-o", blend, "--results", kept, *words)
    assert done.returncode == 2 and "object 1 of 2: " in done.stderr, done.stdout + done.stderr
    assert scenes_of(blend)[0]["pair"][-1] == 2, "one object and its camera"
    assert [path.name for path in (kept / "pair" / "1").iterdir()] == ["diary.txt"]


@pytest.mark.slow
def test_a_photo_is_decomposed_when_blender_runs_the_script_from_the_source_tree(
    tmp_path: Path,
) -> None:
    blend, kept = tmp_path / "out.blend", tmp_path / "kept"
    script = ROOT / "blender_addon" / "headless.py"
    arguments = [photo(tmp_path), "-o", blend, "--results", kept, "--max-size", 32, "--threads", 1]
    call = [sys.executable, "-P", "-c", AS_BLENDER_DOES, str(script), *map(str, arguments)]
    done = subprocess.run(
        call, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert set(scenes_of(blend)[0]) == {"bump"}
    about = json.loads((kept / "bump" / "decomposition.json").read_text())
    assert about["input"]["name"] == "bump.png"
    assert (kept / "bump" / "arrays.npz").is_file()


@pytest.mark.slow
def test_warnings_of_a_photo_are_printed(tmp_path: Path) -> None:
    image, mask = under_lights((-0.8, 0.4, 0.7))
    overexposed = np.clip(np.rint(255 * 4 * image / image.max()), 0, 255).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "ball.png"), overexposed[..., ::-1])
    cv2.imwrite(str(tmp_path / "mask.png"), np.uint8(255) * mask)
    done = run(
        tmp_path / "ball.png",
        "--mask",
        tmp_path / "mask.png",
        "--results",
        tmp_path / "kept",
        "--max-size",
        48,
    )
    assert done.returncode == 0, done.stderr
    status = json.loads((tmp_path / "kept" / "ball" / "decomposition.json").read_text())["status"]
    assert status["warnings"], "the case does not serve"
    assert all(line in done.stdout for line in status_lines(status)), done.stdout


OLD_STATUS = {  # of schema 1
    "converged": False,
    "help": "more steps",
    "gloss": "next to no highlights were found",
    "doubts": ["it looks like a mirror", "there seem to be several lights"],
}


@pytest.mark.slow
def test_warnings_of_a_result_folder_are_printed(tmp_path: Path) -> None:
    """Invalid entries of the status are ignored."""
    result, odd = write_result(tmp_path / "all" / "cup"), write_result(tmp_path / "all" / "odd")
    for folder, status in (
        (result, OLD_STATUS),
        (odd, {"gloss": 3, "doubts": {"a": 1}, "light_colour": "red"}),
    ):
        about = json.loads((folder / "decomposition.json").read_text())
        (folder / "decomposition.json").write_text(json.dumps({**about, "status": status}))
    done = run(tmp_path / "all", "-o", tmp_path / "out", "--quiet")
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stdout.splitlines() if line.startswith(str(tmp_path / "all"))]
    assert said == [f"{result}: " + "; ".join(status_lines(OLD_STATUS))]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["none.png", "-o", "x.blend"], "none.png: no such photo or folder"),
        (["RESULT"], "no output: give"),
        (
            ["RESULT", "-o", "x.blend", "--samples", "0"],
            "argument --samples: '0' is not a whole number, 1 or",
        ),
        (["RESULT", "-o", "x.blend", "--triangles", "-4"], "'-4' is not a whole number, 0 or more"),
        (["RESULT", "-o", "x.blend", "--size", "nan"], "'nan' is not a number other than 0"),
        (["RESULT", "-o", "x.blend", "--texture-size", "0"], "'0' is not photo, maps or a number"),
        (["RESULT", "-o", "RESULT/arrays.npz/x.blend"], "a part of the path is a file"),
        (
            ["RESULT", "--render", "x.jpg"],
            "--render x.jpg: give a file that ends in .png or .exr, or a folder",
        ),
        (["RESULT", "-o", "x.txt"], "-o x.txt: give a file that ends in .blend, or a folder"),
        (["RESULT", "--render", "x.png", "--nonsense"], "unrecognized arguments: --nonsense"),
    ],
)
def test_invalid_arguments_are_refused_in_one_line_before_any_work(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    says: str,
) -> None:
    result = write_result(tmp_path / "RESULT")
    monkeypatch.chdir(tmp_path)
    assert main([argument.replace("RESULT", str(result)) for argument in arguments]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1, said
    assert [path.name for path in tmp_path.iterdir()] == ["RESULT"]


@pytest.mark.slow
def test_a_failed_source_does_not_stop_the_others(tmp_path: Path) -> None:
    for name in ("cup", "jug"):
        write_result(tmp_path / "all" / name)
    (tmp_path / "all" / "cup" / "arrays.npz").write_bytes(b"nothing")
    done = run(tmp_path / "all", "-o", tmp_path / "out", "--quiet")
    assert done.returncode == 2
    assert done.stderr.count("all/cup") == 1
    assert done.stderr.count("\n") == 1, done.stderr
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["jug.blend"]


@pytest.mark.slow
def test_ctrl_c_ends_the_worker_and_leaves_nothing(tmp_path: Path) -> None:
    call = command(photo(tmp_path), "-o", tmp_path / "out.blend")
    with subprocess.Popen(
        call, cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stderr is not None
        first = process.stderr.readline()  # the worker is at work
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read()
        assert process.wait(60) == 130, first + rest
    assert rest.splitlines()[-1] == "blender: cancelled"
    assert [path.name for path in tmp_path.iterdir()] == ["bump.png"]


def test_signal_handlers_set_in_c_are_tolerated(monkeypatch: pytest.MonkeyPatch) -> None:
    """For those that Blender has set, `signal.signal` returns None, and cannot restore them."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    original = signal.signal

    def replace_unknown(number: signal.Signals, handler: Any) -> None:
        original(number, handler)

    try:
        monkeypatch.setattr(signal, "signal", replace_unknown)
        with Interrupts():
            assert signal.getsignal(signal.SIGINT) != before[signal.SIGINT]
        assert {signal.getsignal(number) for number in before} == {signal.SIG_DFL}
    finally:
        for number, handler in before.items():
            original(number, handler)


@pytest.mark.parametrize("transfer", ["auto", "linear"])
def test_an_update_reads_the_photo_with_the_same_transfer_curve(
    blender: Any, tmp_path: Path, transfer: str
) -> None:
    from blender_addon.files.image_source import inspect_image
    from blender_addon.headless_batch import _create_request
    from blender_addon.headless_command import _parser
    from blender_addon.headless_sources import Source

    source = Source(photo(tmp_path), "bump")
    words = [str(source.path), "--transfer", transfer, "-o", str(tmp_path / "a.blend")]
    request = _create_request(source, _parser().parse_args(words))
    assert inspect_image(blender.data.images[request.image]).transfer == transfer


def test_an_internal_error_has_a_nonzero_exit_code(tmp_path: Path) -> None:
    """Blender itself ends with 0 after a script that raised."""
    code = "import runpy, sys, blender_addon.headless_command as c; c.main = None; "
    code += "sys.argv = ['headless']; "
    code += "runpy.run_module('blender_addon.headless', run_name='__main__')"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert done.returncode == 1
    assert "TypeError" in done.stderr
