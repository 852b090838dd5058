"""`isc decompose --highlight`: what is taken off, noted, and refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from isc_core.cli.main import main
from tests.core.command_line import ball_photo, write_image


def decompose(photo: Path, output: Path, *options: str) -> int:
    words = ["decompose", str(photo), "--max-size", "48", "--detail", "0", "-o", str(output)]
    return main([*words, *options])


def test_a_mark_where_there_is_no_highlight_is_noted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo, output = tmp_path / "matt.png", tmp_path / "result"
    row, column = np.indices((60, 60)) - 29.5
    shading = np.sqrt(np.maximum(24**2 - row**2 - column**2, 0)) / 24
    write_image(photo, np.rint(255 * shading[..., None] * [0.9, 0.3, 0.2]).astype(np.uint8))
    assert decompose(photo, output, "--highlight=30,31") == 0
    assert "no light was taken off at 30,31" in capsys.readouterr().out
    stored = json.loads((output / "decomposition.json").read_text())["input"]
    assert stored["marked_highlights"] == [[30, 31]] and "marked_paint" not in stored


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--highlight=0,0"], "the mark 0,0 lies outside of the object"),
        (["--not-highlight=99999,0"], "lies outside of the object"),
        (["--highlight=3"], "is not two integers x,y"),
        (["--highlight=40,40", "--model", "sirfs"], "use --model joint"),
        (["--highlight=40,40", "--each"], "give one photo without --each"),
    ],
)
def test_what_cannot_be_marked_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    photo = ball_photo(tmp_path)
    assert decompose(photo, tmp_path / "result", *options, "-q") == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1
    assert not (tmp_path / "result").exists()
