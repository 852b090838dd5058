"""`--texture-size`: the arrays hold a finer base colour, or the command is refused."""

from pathlib import Path

import numpy as np
import pytest

from isc_core.cli.main import main
from isc_core.result_files.arrays_file import ARRAYS
from tests.core.command_line import ball_photo


def decompose(folder: Path, *options: str) -> int:
    photo, output = ball_photo(folder), folder / "result"
    words = ["decompose", str(photo), "--model", "naive", "--max-size", "24", "-o", str(output)]
    return main([*words, *options])


@pytest.mark.parametrize("size", ["photo", "50", "maps"])
def test_the_arrays_hold_the_texture(tmp_path: Path, size: str) -> None:
    assert decompose(tmp_path, "--arrays", "--texture-size", size) == 0
    with np.load(tmp_path / "result" / ARRAYS) as arrays:
        if size == "maps":
            assert "texture" not in arrays
            return
        texture, photo, maps = arrays["texture"], arrays["photo_size"], arrays["mask"].shape
    assert texture.dtype == np.uint8 and min(texture.shape[:2]) > min(maps)
    longest = int(max(photo)) if size == "photo" else int(size)
    assert longest - 4 <= max(texture.shape) <= longest + 2 * (size == "photo")


def test_it_needs_arrays(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert decompose(tmp_path, "--texture-size", "photo") == 2
    assert "add --arrays" in capfd.readouterr().err
    assert not (tmp_path / "result").exists()


@pytest.mark.parametrize("size", ["0", "-1", "large", "2.5"])
def test_other_sizes_are_refused(
    tmp_path: Path, size: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert decompose(tmp_path, "--arrays", f"--texture-size={size}") == 2
    assert "not photo, maps or a number of pixels" in capfd.readouterr().err
