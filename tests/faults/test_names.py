"""Photos, masks and outputs may have any name that the file system takes; whatever is written and
printed stays readable.
"""

import json
import os
import shutil
import sys
from pathlib import Path

import pytest
from PIL import Image

from isc_core.cli.main import main
from isc_core.io.exr import read_channels
from isc_core.io.printable_names import readable
from isc_core.photo import read_photo
from isc_core.result_files.result_folder import load
from tests.core.command_line import ball_codes, ball_photo, run_isc, write_image

NAMES = {
    "not UTF-8": b"caf\xe9",
    "line break": b"two\nlines",
    "long": b"n" * 240,
    "longer than the sheet": "杯".encode() * 70,
    "of markup and colour": b"<b>&\"'\x1b[31m{0}%s\\",
    "right to left": "a\u202eb\u05d0".encode(),
    "like an option": b"-o",
    "spaces": b" a b ",
}

named = pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)


def place(folder: Path, name: bytes, suffix: bytes = b"") -> Path:
    """A path of that name; skip the test where the file system refuses it."""
    path = Path(os.fsdecode(os.path.join(os.fsencode(folder), name + suffix)))
    try:
        path.touch()
        path.unlink()
    except OSError:
        pytest.skip("this file system refuses the name")
    return path


def moved(source: Path, target: Path) -> Path:
    shutil.move(source, target)
    return target


def ran(capfd: pytest.CaptureFixture[str], *words: object) -> str:
    """Run a command that succeeds; return what it printed, which can be encoded."""
    code = main([str(word) for word in words])
    out, err = capfd.readouterr()
    assert code == 0, (out, err)
    assert "Traceback" not in err
    (out + err).encode()
    return out


@pytest.mark.slow
@named
def test_photo_mask_and_output(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: bytes
) -> None:
    photo = moved(ball_photo(tmp_path), place(tmp_path, name, b".png"))
    codes = ball_codes()
    mask = moved(
        write_image(tmp_path / "mask.png", (codes.max(-1) > 0) * codes.dtype.type(65535)),
        place(tmp_path, name, b".mask.png"),
    )
    output = place(tmp_path, name)
    words = (f"./{os.path.relpath(photo, tmp_path)}", "--mask", mask)
    os.chdir(tmp_path)
    ran(capfd, "decompose", *words, "--model", "naive", "-o", output / "result")
    result = load(output / "result")
    assert not result.identity_errors().broken()
    described = json.loads((output / "result" / "decomposition.json").read_bytes())
    assert described["input"]["name"] == readable(photo.name)
    assert described["input"]["sha256"] == read_photo(photo, mask).original.sha256
    described["input"]["name"].encode()
    ran(capfd, "separate", *words, "--method", "shen_2013", "-o", output / "layers")
    assert read_channels(output / "layers" / "separation.exr")
    given = ("--photo", photo, "--mask", mask)
    ran(capfd, "edit", output / "result", "relight", "--yaw", "40", *given, "-o", output / "turned")
    edit = json.loads((output / "turned" / "edit.json").read_text(encoding="utf-8"))
    assert "photo" in edit["parameters"]
    Image.open(output / "turned" / "before_after.png").load()
    ran(capfd, "mask", photo, "--box", "3,3,50,46", "-o", output / f"{output.name[:60]}.png")
    ran(capfd, "arrays", output / "result")
    assert not list(output.rglob(".*"))


@named
def test_photo_of_floats(tmp_path: Path, capfd: pytest.CaptureFixture[str], name: bytes) -> None:
    first = tmp_path / "first"
    ran(capfd, "decompose", ball_photo(tmp_path), "--model", "naive", "--quiet", "-o", first)
    photo = moved(first / "maps" / "diffuse.exr", place(tmp_path, name, b".exr"))
    ran(capfd, "separate", photo, "--method", "none", "--quiet", "-o", tmp_path / "out")
    assert read_channels(tmp_path / "out" / "separation.exr")


@named
def test_refusal_takes_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: bytes
) -> None:
    photo = place(tmp_path, name, b".png")
    assert main(["separate", str(photo), "-o", str(tmp_path / "out")]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1 and "no such file" in err


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="names are text there")
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_terminal_of_any_encoding(tmp_path: Path, encoding: str) -> None:
    """In a new process, where standard output is strict."""
    photo = moved(ball_photo(tmp_path), place(tmp_path, b"caf\xe9", b".png"))
    before = f"import sys; sys.stdout.reconfigure(encoding={encoding!r}, errors='strict')"
    output = tmp_path / "gr\u00fc\u00dfe"
    done = run_isc("separate", photo, "--method", "none", "-o", output, before=before)
    assert done.returncode == 0, done.stderr
    assert "preview.png" in done.stdout and (output / "preview.png").is_file()


def test_printable_names_stay() -> None:
    assert readable("Grüße 杯 קפה émoji 👩‍🔧.png") == "Grüße 杯 קפה émoji 👩‍🔧.png"
    assert (
        readable("a\nb\t\x1b\u2028\u202e\udce9\ud800") == "a\\nb\\t\\x1b\\u2028\\u202e\\xe9\\ud800"
    )


# --- outputs that name an input ------------------------------------------------------------------


def test_mask_never_replaces_its_photo(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    photo = ball_photo(tmp_path)
    before = photo.read_bytes()
    (tmp_path / "link.png").symlink_to(photo)
    os.link(photo, tmp_path / "same.png")
    for output in ("ball.png", "link.png", "same.png"):
        assert main(["mask", str(photo), "--box", "3,3,50,46", "-o", str(tmp_path / output)]) == 2
        assert "is the photo itself" in capfd.readouterr().err
    assert photo.read_bytes() == before


@pytest.mark.parametrize(
    "command",
    [("decompose", "--model", "naive"), ("separate", "--method", "none")],
    ids=lambda c: c[0],
)
def test_folder_of_the_photo_is_no_output(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], command: tuple[str, ...]
) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "photos")
    photo = ball_photo(tmp_path / "photos")
    for output in ("photos", "link", "photos/../photos"):
        assert main([command[0], str(photo), *command[1:], "-o", str(tmp_path / output)]) == 2
        assert "choose another folder" in capfd.readouterr().err
    assert [path.name for path in (tmp_path / "photos").iterdir()] == ["ball.png"]


def test_result_that_holds_the_photo_is_not_replaced(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """An image of an earlier result, decomposed into that result's own folder, would be lost."""
    words = ("--model", "naive", "--quiet", "-o", tmp_path / "out")
    ran(capfd, "decompose", ball_photo(tmp_path), *words)
    inside = tmp_path / "out" / "maps" / "diffuse.exr"
    before = inside.read_bytes()
    for command in (("decompose", "--model", "naive"), ("separate", "--method", "none")):
        assert main([command[0], str(inside), *command[1:], "-o", str(tmp_path / "out")]) == 2
        assert capfd.readouterr().err.count("\n") == 1
    assert inside.read_bytes() == before


def test_link_as_output_is_followed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    photo = ball_photo(tmp_path)
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    (tmp_path / "nowhere").symlink_to("gone")
    for name, real in (("link", "real"), ("nowhere", "gone")):
        ran(capfd, "separate", photo, "--method", "none", "--quiet", "-o", tmp_path / name)
        assert (tmp_path / name).is_symlink() and (tmp_path / real / "separation.exr").is_file()
    (tmp_path / "round").symlink_to("round")
    assert main(["separate", str(photo), "--method", "none", "-o", str(tmp_path / "round")]) == 2
    assert capfd.readouterr().err.count("\n") == 1
