"""`isc decompose --refine`: the gloss is refined after the decomposition, and said so."""

from pathlib import Path

import pytest

from isc_core.cli.main import main
from isc_core.refinement.gloss_note import gloss_line
from isc_core.result_files.result_folder import load
from tests.core.command_line import ball_photo


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
