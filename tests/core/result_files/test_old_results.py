"""Result folders of the first schema, whose status held sentences, still load."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from isc_core.errors import InputError
from isc_core.lobe_fitting import fit_lobe
from isc_core.result_files.result_folder import SCHEMA_VERSION, load, save
from isc_core.scene.diagnostics import AssumptionWarning, LobeFitOutcome, WarningKind
from tests.core.ball_scene import ball

STATUS = {
    "converged": True,
    "reason": "loss",
    "loss": 46.5,
    "terms": {"light": 1.5},
    "help": "",
    "gloss": "roughness at most 0.31: the highlight is narrower than a pixel: only an upper bound",
    "kinds": {"ordinary": 1.0},
    "lamps": {"none": 0.0, "one": 1.0, "several": 0.0},
    "doubts": [
        "there seem to be several lights: one was looked for, so shape, paint and gloss are less to"
        " be trusted; use one lamp if you can"
    ],
}


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A result as the first schema wrote it."""
    d = ball((48, 60), 20.0, (22, 33))
    folder = tmp_path / "result"
    save(replace(d, brdf=fit_lobe(d.specular, d.normal, d.mask)), folder)
    change(folder, status=STATUS, schema_version=1)
    about = json.loads((folder / "decomposition.json").read_text())
    about["settings"] |= {"light_prior": "seen", "shape_prior": "outline"}
    del about["brdf"]["outcome"]
    about["brdf"]["reason"] = "the highlight is narrower than a pixel: only an upper bound"
    about["brdf"]["determined"] = False
    change(folder, **about)
    return folder


def change(folder: Path, **entries: object) -> None:
    path = folder / "decomposition.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | entries))


@pytest.mark.slow
def test_a_result_of_the_first_schema_loads(old: Path) -> None:
    found = load(old)
    diagnostics = found.provenance.diagnostics
    assert (diagnostics.converged, diagnostics.loss) == (True, 46.5)
    assert diagnostics.lobe is not None and diagnostics.lobe.outcome == LobeFitOutcome.NARROW
    assert diagnostics.warnings == (AssumptionWarning(WarningKind.SEVERAL_LIGHTS),)
    assert found.brdf is not None and found.brdf.outcome == LobeFitOutcome.NARROW
    assert not found.brdf.determined


@pytest.mark.slow
def test_it_is_saved_in_the_present_schema(old: Path, tmp_path: Path) -> None:
    found = load(old)
    save(found, tmp_path / "again")
    about = json.loads((tmp_path / "again" / "decomposition.json").read_text())
    assert about["schema_version"] == SCHEMA_VERSION
    assert about["status"]["warnings"] == [{"kind": "several lights", "value": None}]
    assert load(tmp_path / "again").provenance.diagnostics == found.provenance.diagnostics


@pytest.mark.slow
def test_an_unknown_reason_is_rejected(old: Path) -> None:
    about = json.loads((old / "decomposition.json").read_text())
    change(old, brdf=about["brdf"] | {"reason": "it is Tuesday"})
    with pytest.raises(InputError, match="no usable brdf"):
        load(old)
