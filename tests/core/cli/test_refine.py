"""`isc decompose --refine`: the gloss is refined after the decomposition, and said so."""

import json
from pathlib import Path

import numpy as np
import pytest

from isc_core.cli.commands import build_parser
from isc_core.cli.main import main
from isc_core.errors import Cancelled
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.io.checkpoint import Checkpoint
from isc_core.progress import Monitor, ProgressEvent
from isc_core.refinement.gloss_note import gloss_line
from isc_core.result_files.result_folder import load
from tests.core.command_line import ball_photo, write_image
from tests.core.refinement.test_gloss import glossy

CONTINUED = "continued an interrupted run"
REFINING = "refining the gloss"


@pytest.mark.slow
def test_refining_is_recorded_and_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo = ball_photo(tmp_path)
    assert main(["decompose", str(photo), "--refine", "-o", str(tmp_path / "out")]) == 0
    found = load(tmp_path / "out")
    assert found.identity_errors().broken() == ()
    note = found.provenance.settings["refine_gloss"]
    assert note["seed"] == 0
    said = capsys.readouterr()
    assert gloss_line(found.provenance.settings) in said.out + said.err


def glossy_photo(folder: Path) -> list[str]:
    """Writes the photo of a red dome with a highlight and its shape; the words that name them."""
    d = glossy()
    image = d.diffuse * np.array([1.25, 0.5, 0.25]) + d.specular
    codes = np.rint(65535 * np.clip(linear_to_srgb(image), 0, 1)).astype(np.uint16)
    y, x = np.unravel_index(d.specular[..., 0].argmax(), d.mask.shape)
    np.save(folder / "shape.npy", d.height)
    photo = write_image(folder / "dome.png", codes)
    return [str(photo), "--shape", str(folder / "shape.npy"), "--highlight", f"{x},{y}"]


def decompose(words: list[str], monitor: Monitor | None = None) -> list[str]:
    """Runs `isc decompose`; returns the lines to print."""
    words = ["decompose", *words]
    options = build_parser(words).parse_args(words)
    lines: list[str] = options.run(options, monitor or Monitor())
    return lines


def contents(folder: Path) -> dict[str, object]:
    """The files of a result, without the times in it."""
    files = (path for path in folder.rglob("*") if path.is_file())
    found: dict[str, object] = {str(path.relative_to(folder)): path.read_bytes() for path in files}
    description = json.loads((folder / "decomposition.json").read_text())
    assert description["settings"]["refine_gloss"]["outcome"] == "refined"
    return found | {"decomposition.json": description | {"timings": {}}}


class Reports:
    """Counts the reports of the refinement, and cancels after some, if a number is given."""

    def __init__(self, most: int | None = None) -> None:
        self.count = 0
        self.most = most

    def monitor(self) -> Monitor:
        return Monitor(self._add, lambda: self.count == self.most)

    def _add(self, event: ProgressEvent) -> None:
        self.count += event.stage == REFINING


def interrupt(words: list[str], reports: int) -> list[str]:
    """Runs the command until so many reports of the refinement; returns the notes of the end."""
    with pytest.raises(Cancelled) as cancellation:
        decompose(words, Reports(reports).monitor())
    return getattr(cancellation.value, "__notes__", [])


@pytest.mark.slow
def test_a_refinement_is_continued_where_it_was_interrupted(tmp_path: Path) -> None:
    photo, output, cache = glossy_photo(tmp_path), tmp_path / "out", tmp_path / "cache"
    inputs, whole = {path.name for path in tmp_path.iterdir()}, Reports()
    decompose([*photo, "--refine", "-o", str(tmp_path / "whole")], whole.monitor())
    most = whole.count - 20
    words = [*photo, "--refine", "-o", str(output)]

    assert interrupt(words, 1) == []
    assert {path.name for path in tmp_path.iterdir()} == inputs | {"whole"}
    (note,) = interrupt(words, most)
    assert note.startswith(f"finished stages are kept in {tmp_path / '.out.checkpoint'}: repeat")
    assert {path.name for path in tmp_path.iterdir()} == inputs | {"whole", ".out.checkpoint"}
    rest = Reports()
    assert CONTINUED in decompose(words, rest.monitor())
    assert rest.count < 0.7 * most, "finished fits are not repeated"
    assert contents(output) == contents(tmp_path / "whole")
    assert {path.name for path in tmp_path.iterdir()} == inputs | {"whole", "out"}

    words += ["--cache", str(cache), "--arrays"]
    assert interrupt(words, most) == []
    rest = Reports()
    decompose(words, rest.monitor())
    assert rest.count < 0.7 * most, "finished fits are not repeated"
    found = contents(output)
    assert found.pop("arrays.npz") and found == contents(tmp_path / "whole")
    assert {path.name for path in tmp_path.iterdir()} == inputs | {"whole", "out", "cache"}


@pytest.mark.slow
def test_what_another_run_has_kept_goes_when_the_output_is_complete(tmp_path: Path) -> None:
    kept = Checkpoint(tmp_path / "out")
    kept.arrays("fit", [np.zeros(1)], lambda: {"x": np.zeros(1)})
    lines = decompose([str(ball_photo(tmp_path)), "-o", str(tmp_path / "out")])
    assert any(line.startswith("note: 1 kept stage was not used") for line in lines)
    assert {path.name for path in tmp_path.iterdir()} == {"ball.png", "out"}
