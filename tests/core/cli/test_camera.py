"""`--camera`, and what `isc decompose` makes of a photo's metadata."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from isc_core.cli.main import main
from isc_core.io.focal_length import pixels_of_35mm
from tests.core.command_line import ball_codes

IN_35MM, PIXEL_X, PIXEL_Y = 0xA405, 0xA002, 0xA003
FAST = ("--model", "naive", "--max-size", "24", "--threads", "1")


def phone_photo(folder: Path, tags: dict[int, int]) -> tuple[Path, Path]:
    """A JPEG of a ball with EXIF, and its mask."""
    codes = (ball_codes() >> 8).astype(np.uint8)
    data = Image.Exif()
    data.get_ifd(0x8769).update(tags)
    Image.fromarray(codes).save(folder / "phone.jpg", quality=95, exif=data)
    cv2.imwrite(str(folder / "mask.png"), np.where(codes.max(2) > 0, 255, 0).astype(np.uint8))
    return folder / "phone.jpg", folder / "mask.png"


def camera_of(folder: Path) -> dict[str, object]:
    return dict(json.loads((folder / "decomposition.json").read_text())["camera"])


def decompose(photo: Path, mask: Path, output: Path, *words: str) -> int:
    return main(["decompose", str(photo), "--mask", str(mask), "-o", str(output), *FAST, *words])


def test_the_metadata_or_the_option_give_the_camera(tmp_path: Path) -> None:
    photo, mask = phone_photo(tmp_path, {IN_35MM: 26})
    height, width = cv2.imread(str(photo)).shape[:2]
    found = []
    for words in ((), ("--camera", "orthographic"), ("--camera", "52")):
        assert decompose(photo, mask, tmp_path / "out", *words) == 0
        found.append(camera_of(tmp_path / "out"))
    auto, flat, given = found
    assert (auto["source"], flat["source"], given["source"]) == ("exif", "none", "option")
    assert flat["type"] == "orthographic"
    description = json.loads((tmp_path / "out" / "decomposition.json").read_text())
    focal = pixels_of_35mm(26, (width, height)) * description["input"]["scale"]
    assert auto["focal_length"] == pytest.approx(focal)
    assert given["focal_length"] == pytest.approx(2 * focal)
    assert description["settings"]["camera"] == "52"


def test_the_configuration_file_may_give_a_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    photo, mask = phone_photo(tmp_path, {})
    monkeypatch.chdir(tmp_path)
    Path("isc.toml").write_text("[decompose]\ncamera = 28\n")
    assert decompose(photo, mask, tmp_path / "out") == 0
    assert camera_of(tmp_path / "out")["source"] == "option"


def test_a_cropped_photo_is_orthographic_with_a_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo, mask = phone_photo(tmp_path, {IN_35MM: 26, PIXEL_X: 4000, PIXEL_Y: 2000})
    assert decompose(photo, mask, tmp_path / "out") == 0
    assert "was cropped" in capsys.readouterr().out
    assert camera_of(tmp_path / "out")["type"] == "orthographic"
    assert decompose(photo, mask, tmp_path / "out", "--camera", "orthographic") == 0
    assert "was cropped" not in capsys.readouterr().out


@pytest.mark.parametrize("camera", ["0", "-28", "wide", "28mm", "1e9"])
def test_an_impossible_camera_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], camera: str
) -> None:
    photo, mask = phone_photo(tmp_path, {})
    assert decompose(photo, mask, tmp_path / "out", f"--camera={camera}") == 2
    error = capsys.readouterr().err
    assert "unknown camera" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
