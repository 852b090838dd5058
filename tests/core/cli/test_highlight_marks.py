"""`isc decompose --highlight`: what is removed, noted, and refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import isc_core
from isc_core.cli.interface.highlight_options import mark_notes
from isc_core.cli.main import main
from isc_core.decomposition.settings import Settings
from isc_core.photo.highlight_marks import HighlightMarks, mark_radius
from isc_core.photo.reading import read_photo
from tests.core.command_line import ball_codes, ball_photo, write_image


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
    assert "no highlight was removed at 30,31" in capsys.readouterr().out
    stored = json.loads((output / "decomposition.json").read_text())["input"]
    assert stored["marked_highlights"] == [[30, 31]] and "marked_paint" not in stored


@pytest.mark.parametrize(("further", "noted"), [(-0.5, False), (1.5, True)])
def test_the_note_uses_the_radius_of_marks(tmp_path: Path, further: float, noted: bool) -> None:
    """Whatever the frame around the object."""
    path, codes = tmp_path / "ball.png", np.zeros((60, 900, 3), np.uint16)
    codes[:52, :56] = ball_codes()
    photo = read_photo(write_image(path, codes))
    result = isc_core.decompose(photo.image, photo.mask, settings=Settings(model="naive"))
    specular = np.zeros_like(result.specular)
    specular[30, 30] = 1
    x = 30.5 + mark_radius(result.mask) + further
    marked = replace(photo, marks=HighlightMarks(((x, 30.5),)))
    assert bool(mark_notes(marked, replace(result, specular=specular))) is noted


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
