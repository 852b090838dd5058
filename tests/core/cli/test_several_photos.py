"""Several photos, a photo from standard input, PNG layers, --open, -v, and completion."""

import errno
import json
import os
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isc_core.cli.interface.several import do_all
from isc_core.cli.main import main
from isc_core.errors import Cancelled, InputError, Rejected
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.progress import Monitor, ProgressEvent
from isc_core.result_files.result_folder import load
from tests.core.command_line import ROOT, ball_codes, ball_photo, isc_command, write_image

NAIVE = ("--model", "naive")


def isc(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


def two_photos(folder: Path) -> tuple[Path, Path]:
    return ball_photo(folder), write_image(folder / "other ball.png", ball_codes(24.0))


@pytest.mark.slow
def test_several_photos_get_a_folder_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = two_photos(tmp_path)
    assert isc("decompose", first, second, *NAIVE, "-o", tmp_path / "out") == 0
    printed = capsys.readouterr()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["ball", "other_ball"]
    assert load(tmp_path / "out" / "ball").provenance.input["name"] == "ball.png"
    assert printed.out.count("see ") == 2 and "other ball.png: writing maps" in printed.err
    assert isc("decompose", first, *NAIVE, "-q", "-o", tmp_path / "one") == 0
    alone, together = (load(tmp_path / name) for name in ("one", "out/ball"))
    assert np.array_equal(alone.reflectance, together.reflectance)


@pytest.mark.parametrize("several", [True, False])
def test_several_results_are_not_written_into_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], several: bool
) -> None:
    first, second = two_photos(tmp_path)
    assert isc("decompose", first, *NAIVE, "-q", "-o", tmp_path / "out") == 0
    before = sorted(tmp_path.glob("out/**/*"))
    words = (first, second) if several else (first, "--each")
    assert isc("decompose", *words, *NAIVE, "-q", "-o", tmp_path / "out") == 2
    assert "is the result of one object" in capsys.readouterr().err
    assert sorted(tmp_path.glob("out/**/*")) == before


def test_a_photo_that_fails_does_not_stop_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = two_photos(tmp_path)
    broken = tmp_path / "broken.png"
    broken.write_bytes(first.read_bytes()[:200])
    assert isc("decompose", first, broken, second, *NAIVE, "-q", "-o", tmp_path / "out") == 1
    errors = capsys.readouterr().err.splitlines()
    assert "broken.png" in errors[0] and errors[1].endswith("1 of 3 photos failed")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["ball", "other_ball"]


def two_balls(folder: Path) -> Path:
    """A photo of two balls on black."""
    ball = ball_codes(12.0)
    both = np.concatenate([ball, 0.8 * ball], axis=1).astype("uint16")
    return write_image(folder / "shelf.png", both)


@pytest.mark.slow
def test_an_edit_of_one_of_several_objects_changes_it_only(tmp_path: Path) -> None:
    """The alpha channel shows all objects; `mask.png` of the result says which."""
    with Image.open(two_balls(tmp_path)) as image:
        color = np.asarray(image.convert("RGB"))
    alpha = np.where(color.any(-1), np.uint8(255), np.uint8(0))
    photo = tmp_path / "balls.png"
    Image.fromarray(np.dstack([color, alpha])).save(photo)
    assert isc("decompose", photo, "--each", *NAIVE, "-q", "-o", tmp_path / "out") == 0
    for number in (1, 2):
        given = ("edit", tmp_path / "out" / str(number), "recolour", "--value", "0.5")
        assert isc(*given, "--photo", photo, "-q", "-o", tmp_path / "edit") == 0
        after = np.asarray(Image.open(tmp_path / "edit" / "edited.png"))
        columns = np.nonzero((after[..., :3] != color).any((0, 2)))[0]
        half = color.shape[1] / 2
        assert len(columns) > 20
        assert columns.max() < half if number == 1 else columns.min() > half


def test_a_failing_object_does_not_stop_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo, out = two_balls(tmp_path), tmp_path / "out"
    (out / "1").mkdir(parents=True)
    (out / "1" / "diary.txt").write_text("mine")
    words = ("decompose", photo, "--each", *NAIVE, "-o", out)
    assert isc(*words) == 1
    printed = capsys.readouterr()
    errors = [line for line in printed.err.splitlines() if "rejected" in line]
    assert "object 1 of 2: " in errors[0] and str(out / "1") in errors[0]
    assert errors[1].endswith("1 of 2 objects failed") and len(errors) == 2
    assert f"see {out / '2' / 'preview.png'}" in printed.out, "what is done is told"
    assert [path.name for path in (out / "1").iterdir()] == ["diary.txt"]
    assert isc("decompose", photo, "--each", *NAIVE, "-q", "-o", tmp_path / "all") == 0
    kept, alone = (load(folder / "2") for folder in (out, tmp_path / "all"))
    assert np.array_equal(kept.reflectance, alone.reflectance)
    assert kept.provenance.input["object"] == 2
    assert isc(*words, "--progress", "json") == 1
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last["event"] == "failed" and last["code"] == 1 and "object 1 of 2: " in last["message"]


def test_an_unreadable_photo_of_several_objects_is_one_failure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo = two_balls(tmp_path)
    photo.write_bytes(photo.read_bytes()[:200])
    assert isc("decompose", photo, "--each", *NAIVE, "-q", "-o", tmp_path / "out") == 2
    assert len(capsys.readouterr().err.splitlines()) == 1 and not (tmp_path / "out").exists()


def test_a_folder_with_results_of_more_objects_is_rejected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo, out = two_balls(tmp_path), tmp_path / "out"
    (out / "3").mkdir(parents=True)
    (out / "3" / "decomposition.json").write_text("{}")
    assert isc("decompose", photo, "--each", *NAIVE, "-q", "-o", out) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{out / '3'} is the result of another run, and this photo has 2 objects" in line
    assert [path.name for path in out.iterdir()] == ["3"]


def test_an_unusable_light_is_one_error_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("decompose", *two_photos(tmp_path), "--light", tmp_path / "none.json")
    assert isc(*words, "-q", "-o", tmp_path / "out") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "none.json" in line and not (tmp_path / "out").exists()


def test_exhausted_memory_or_disk_does_not_stop_the_others() -> None:
    events: list[ProgressEvent] = []

    def work(error: BaseException | None, monitor: Monitor) -> list[str]:
        monitor.report("half", 0.5)
        if error is not None:
            raise error
        return ["done"]

    def run(*errors: BaseException | None) -> list[str]:
        works = {f"object {i}": partial(work, error) for i, error in enumerate(errors)}
        return do_all("objects", works, Monitor(events.append))

    full = OSError(errno.ENOSPC, "No space left on device", "a\nb")
    with pytest.raises(Rejected) as rejected:
        run(MemoryError(), None, full, InputError("object 3 cannot be used"))
    lines = str(rejected.value).splitlines()
    assert lines[0].startswith("object 0: not enough memory") and rejected.value.lines == ["done"]
    assert lines[1:3] == ["object 2: a\\nb: No space left on device", "object 3 cannot be used"]
    assert lines[3] == "3 of 4 objects failed"
    assert [event.stage for event in events] == [f"object {i}: half" for i in range(4)]
    np.testing.assert_allclose([event.fraction for event in events], np.arange(1, 8, 2) / 8)
    for stopping in (Cancelled("now"), BrokenPipeError(), KeyboardInterrupt()):
        events.clear()
        with pytest.raises(type(stopping)):
            run(stopping, None)
        assert len(events) == 1, "what ends the command ends all"


def test_what_belongs_to_one_photo_is_refused_for_several(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = two_photos(tmp_path)
    (tmp_path / "more").mkdir()
    same = shutil.copy(first, tmp_path / "more" / "Ball.jpeg")
    for words, message in (
        ((first, second, "--mask", first), "--mask applies to one photo"),
        ((first, second, "--depth", first), "--depth applies to one photo"),
        ((first, same), "would both be written"),
        ((first, "-"), "- reads one photo from standard input"),
    ):
        assert isc("decompose", *words, "-o", tmp_path / "out") == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "words",
    [
        ("decompose", "-", *NAIVE, "-o", "out"),
        pytest.param(("separate", "-", "--method", "none", "-o", "out"), marks=pytest.mark.slow),
        pytest.param(("mask", "-", "--box", "2,2,48,44", "-o", "out.png"), marks=pytest.mark.slow),
    ],
)
def test_a_photo_from_standard_input(tmp_path: Path, words: tuple[str, ...]) -> None:
    photo = ball_photo(tmp_path)
    command = isc_command(*words[:-1], tmp_path / words[-1], "-q")
    for data, code, message in (
        (photo.read_bytes(), 0, ""),
        (photo.read_bytes()[:99], 2, "isc: error: standard input: the PNG file is damaged"),
        (b"", 2, "isc: error: standard input: the file is empty"),
    ):
        done = subprocess.run(command, cwd=ROOT, input=data, capture_output=True, check=False)
        assert done.returncode == code, done.stderr
        assert done.stderr.decode().startswith(message)
    assert (tmp_path / words[-1]).exists()


def test_standard_input_has_one_reader(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert isc("separate", "-", "--progress", "json", "-o", tmp_path / "out") == 2
    assert "give a file, not -" in capsys.readouterr().out


def test_png_layers_are_the_maps(tmp_path: Path) -> None:
    photo, out = ball_photo(tmp_path), tmp_path / "out"
    assert isc("decompose", photo, *NAIVE, "--png", "-q", "-o", out) == 0
    d = load(out)
    diffuse = np.asarray(Image.open(out / "maps" / "diffuse.png"))
    expected = np.rint(255 * linear_to_srgb(np.clip(d.diffuse, 0, 1)))
    assert np.array_equal(diffuse[..., :3], expected)
    assert np.array_equal(diffuse[..., 3] > 0, d.mask)
    normal = np.asarray(Image.open(out / "maps" / "normal.png"))[..., :3]
    assert np.abs(normal / 127.5 - 1 - d.normal)[d.mask].max() < 0.01
    height = np.asarray(Image.open(out / "maps" / "height.png"))
    assert height.dtype == np.uint16 and height.shape == d.height.shape
    # A result without them replaces it.
    assert isc("decompose", photo, *NAIVE, "-q", "-o", out) == 0
    assert not (out / "maps" / "diffuse.png").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="the viewer is called xdg-open on Linux")
def test_open_shows_the_preview(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    viewer = tmp_path / "bin" / "xdg-open"
    viewer.parent.mkdir()
    viewer.write_text(f'#!/bin/sh\necho "$1" > {tmp_path}/shown\n')
    viewer.chmod(0o755)
    photo, out = ball_photo(tmp_path), tmp_path / "out"
    words = ("separate", photo, "--method", "none", "--open", "-o", out)
    monkeypatch.setenv("PATH", f"{viewer.parent}{os.pathsep}{os.environ['PATH']}")
    assert isc(*words) == 0
    shown = tmp_path / "shown"
    for _ in range(200):
        if shown.exists() and shown.read_text():
            break
        subprocess.run(["sleep", "0.05"], check=True)
    assert shown.read_text().strip() == str(out / "preview.png")


@pytest.mark.skipif(sys.platform != "linux", reason="the viewer is called xdg-open on Linux")
def test_a_machine_without_a_viewer_gets_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    words = ("separate", ball_photo(tmp_path), "--method", "none", "--open", "-o", tmp_path / "out")
    assert isc(*words) == 0
    assert "note: --open found no viewer" in capsys.readouterr().out


def test_verbose_prints_each_stage_with_its_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert isc("decompose", ball_photo(tmp_path), *NAIVE, "-v", "-o", tmp_path / "out") == 0
    lines = capsys.readouterr().err.splitlines()
    times = [float(line.removeprefix("isc: ").split(" s  ")[0]) for line in lines]
    assert len(times) > 3 and times == sorted(times)


# --- completion -----------------------------------------------------------------------------------


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_contains_commands_and_options(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert isc("completion", shell) == 0
    script = capsys.readouterr().out
    for word in ("decompose", "light-direction", "max-size", "glossy-mit", "silhouette"):
        assert word in script
    if shutil.which(shell):
        checked = subprocess.run([shell, "-n"], input=script, text=True, check=False)
        assert checked.returncode == 0


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes(capsys: pytest.CaptureFixture[str]) -> None:
    assert isc("completion", "bash") == 0
    script = capsys.readouterr().out
    for line, expected in (
        ("isc dec", "decompose"),
        ("isc decompose --max-s", "--max-size"),
        ("isc decompose --illumination lab", "laboratory"),
    ):
        words = line.split()
        ask = (
            f"{script}\nCOMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; COMP_LINE='{line}'\n"
            f"COMP_POINT={len(line)}; _shtab_isc isc {words[-1]} {words[-2]}\n"
            'echo "${COMPREPLY[@]}"'
        )
        done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=False)
        assert done.stdout.split() == [expected], done.stderr


def test_an_unknown_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert isc("completion", "tcsh") == 2
    assert "bash" in capsys.readouterr().err
