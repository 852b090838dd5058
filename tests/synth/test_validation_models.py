"""The stage "models": the models' own results, each solved once; means and shares that follow from
the scenes; tables by material.
"""

import importlib
import json
from collections.abc import Iterator
from dataclasses import fields, replace
from math import exp, log
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="rendered scenes need Mitsuba")

from isc_core.cli.main import main
from isc_core.decomposition import layers
from isc_core.decomposition.models import DecompositionTask, SceneEstimate, Settings, solve
from isc_core.decomposition.settings import SEPARATING_MODELS
from isc_core.evaluation.evaluate import Estimate
from isc_core.evaluation.metrics import Scores
from isc_core.photo import Photo, PhotoSource
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from isc_core.separation import separate
from synth.capture.truth import GroundTruth
from synth.validation.measurement.bootstrap import Interval
from synth.validation.measurement.figures import CHAIN, all_figures
from synth.validation.measurement.gains import all_gains
from synth.validation.measurement.measure import (
    SceneResult,
    StageResult,
    ValidationOptions,
    measure_scene,
)
from synth.validation.reporting.cases import write_evidence
from synth.validation.reporting.html import page
from synth.validation.reporting.markdown import summary
from synth.validation.reporting.model_tables import model_findings, model_tables
from synth.validation.reporting.outcome import ValidationOutcome
from synth.validation.stages import separation as separation_stage
from synth.validation.stages.models import (
    PLAIN,
    TRUE_DIFFUSE,
    Variants,
    models_stage,
    run_models,
    score_models,
)
from synth.validation.stages.registry import find_stages
from synth.validation.stages.separation import SEPARATION
from synth.validation.stages.types import BLACK, StageOptions, stage_inputs
from tests.core.small_solves import small_solves
from tests.synth.test_validation import facts, sphere

pytestmark = pytest.mark.slow  # they share a run

EVERY = StageOptions(models=("mbp", "joint", "mdr"))


@pytest.fixture(scope="module", autouse=True)
def _small() -> Iterator[None]:
    """Shape and light hardly matter to these tests."""
    with small_solves():
        yield


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("models") / "scenes"
    chosen = [
        "--shapes",
        "superquadric",
        "--materials",
        "lambert,ggx",
        "--albedos",
        "patches",
        "--lights",
        "sh",
    ]
    assert (
        main(
            [
                "synth",
                "-o",
                str(folder),
                "--count",
                "3",
                "--size",
                "32",
                "--samples",
                "8",
                *chosen,
                "--quiet",
            ]
        )
        == 0
    )
    return folder


def alone(truth: GroundTruth, model: str) -> SceneEstimate:
    """A model on the photo, as `isc decompose` calls it."""
    h, w = truth.mask.shape
    photo = Photo(
        truth.image,
        truth.mask,
        2 * BLACK,
        np.zeros((h, w), bool),
        PhotoSource("", (w, h), 16, "linear", "file"),
    )
    return solve(
        DecompositionTask(photo, photo, Settings(model, EVERY.separator, detail=0, threads=1))
    )


def relative(*ratios: float) -> Scores:
    return Scores(*ratios)


def scene(name: str, true: float, mdr: float, **changes: object) -> SceneResult:
    """Errors of the true diffuse layer and of MDR, all six alike, relative to plain SIRFS."""
    scores = Variants(Scores(*[0.2] * 6), Scores(*[true] * 6), mdr=Scores(*[mdr] * 6))
    return SceneResult(facts(name, **changes), (StageResult("models", scores, 1.0),))


def outcome_of(scenes: tuple[SceneResult, ...]) -> ValidationOutcome:
    stages = (models_stage(("mdr",)),)
    options = ValidationOptions(stages=stages, settings=StageOptions(models=("mdr",)))
    return ValidationOutcome(
        "d",
        "c",
        options,
        scenes,
        all_figures(stages, scenes, 0),
        (),
        (),
        (),
        gains=all_gains(scenes, 0),
    )


def ends(interval: Interval) -> tuple[float, float]:
    """Of an interval that has both."""
    assert interval.low is not None and interval.high is not None
    return interval.low, interval.high


def test_every_model_that_separates_has_its_place() -> None:
    assert {field.name for field in fields(Variants)} == {PLAIN, TRUE_DIFFUSE, *SEPARATING_MODELS}


def test_shared_steps_change_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    truth = sphere(share=0.8)
    energies: list[tuple[float, float]] = []

    def kept(before: float, after: float, *_: Any) -> bool:
        energies.append((before, after))
        return True

    left = np.log(
        np.where(truth.mask, truth.image.mean(axis=2), 1)
        / np.where(truth.mask, truth.diffuse.mean(axis=2), 1)
    )
    joint = importlib.import_module(
        "isc_core.decomposition.joint"
    )  # the package has a function of that name
    seen = np.repeat(
        (left + 1.0 * (left > 0.5))[..., None], 3, axis=2
    )  # so that joint goes beyond MDR
    monkeypatch.setattr(joint, "ratio_lower_bound", lambda *given: seen)
    monkeypatch.setattr(joint, "lowers_energy", kept)
    answers = dict(run_models(stage_inputs(truth, ("diffuse",)), EVERY, Monitor()).items())
    for name in (PLAIN, *SEPARATING_MODELS):
        model = "sirfs" if name == PLAIN else name
        found, direct = answers[name], alone(truth, model)
        np.testing.assert_allclose(
            found.height[truth.mask], direct.height[truth.mask], atol=1e-6, err_msg=model
        )
        remade = (found.reflectance * found.shading)[truth.mask]
        np.testing.assert_allclose(
            remade, direct.split.diffuse[truth.mask], atol=1e-5, err_msg=model
        )
    assert np.array_equal(answers["mbp"].height, answers[PLAIN].height)
    assert not np.array_equal(answers[PLAIN].height, answers["mdr"].height)
    assert not np.allclose(answers["joint"].reflectance, answers["mdr"].reflectance, rtol=0.05)
    assert energies[0] == pytest.approx(energies[1], rel=1e-6)


def test_the_photo_is_separated_once_and_by_colour_for_the_joint_model(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[str] = []

    def counted(method: str, *given: Any, **more: Any) -> Separation:
        calls.append(method)
        return separate(method, *given, **more)

    monkeypatch.setattr(separation_stage, "separate", counted)
    monkeypatch.setattr(layers, "separate", counted)
    stages = (SEPARATION, models_stage(EVERY.models))
    found = measure_scene(facts("s"), sphere(), stages, EVERY, Monitor())
    separators = [EVERY.separator] * 2
    assert not found.refused and [method for method in calls if method != "none"] == separators
    calls.clear()
    assert not measure_scene(
        facts("s"), sphere(), stages[1:], EVERY, Monitor()
    ).refused  # without the stage before it, too
    assert [method for method in calls if method != "none"] == separators


def test_a_perfect_separation_makes_mdr_the_true_diffuse_layer_s_equal() -> None:
    truth = sphere()
    perfect = Separation(
        truth.diffuse, truth.specular, truth.residual, truth.mask.astype(np.float32)
    )
    options = StageOptions(models=("mdr",))
    answers = run_models(
        replace(stage_inputs(truth, ("diffuse",)), split=perfect), options, Monitor()
    )
    assert answers.mdr is not None and answers.joint is None and answers.mbp is None
    assert np.array_equal(answers.mdr.height, answers.true_diffuse.height)
    scores = score_models(truth, answers)
    assert scores.mdr == scores.true_diffuse and scores.true_diffuse.reflectance < 1


def test_errors_count_relative_to_plain_sirfs() -> None:
    truth = sphere()
    normal, light, zero = (
        truth.normal.astype(float),
        truth.illumination,
        np.zeros_like(truth.height),
    )
    right = Estimate(truth.height, normal, truth.shading, truth.reflectance, light)
    ones = np.where(truth.mask[..., None], np.ones(3), 0)
    flat = Estimate(zero, np.broadcast_to([0.0, 0, 1], normal.shape), ones, ones, 0 * light)
    scores = score_models(truth, Variants(plain=flat, true_diffuse=flat, mdr=right))
    assert scores.true_diffuse == relative(1, 1, 1, 1, 1, 1)
    assert (
        scores.mdr is not None and max(vars(scores.mdr).values()) < 1e-3 and scores.plain.height > 1
    )
    assert (
        score_models(truth, Variants(plain=right, true_diffuse=right)).true_diffuse.height == 1
    )  # none has an error


def test_means_and_shares_follow_from_the_scenes() -> None:
    scenes = tuple(
        scene(f"s{k}", true, mdr)
        for k, (true, mdr) in enumerate([(0.4, 0.7), (0.5, 0.8), (0.6, 0.9)])
    )
    outcome = outcome_of(scenes)
    mean = {
        name: exp(sum(map(log, values)) / 3)
        for name, values in (("true", (0.4, 0.5, 0.6)), ("mdr", (0.7, 0.8, 0.9)))
    }
    (figure,) = [
        f for f in outcome.figures if f.metric.name == "mdr.average" and f.group.kind == "all"
    ]
    assert figure.interval.value == pytest.approx(mean["mdr"])
    low, high = ends(figure.interval)
    assert 0.7 <= low < mean["mdr"] < high <= 0.9
    (gain,) = [g for g in outcome.gains if g.error == "average" and g.group.kind == "all"]
    assert gain.share.value == pytest.approx((1 - mean["mdr"]) / (1 - mean["true"]))
    low, high = ends(gain.share)
    assert (
        0.25 - 1e-9 <= low < gain.share.value < high <= 0.5 + 1e-9
    )  # of the worst scene and of the best
    assert any(
        text.startswith("mdr: 0.796 [") and "40 %" in text for text in model_findings(outcome)
    )


def test_there_is_no_share_of_a_missing_gain_and_no_interval_of_an_insignificant_one() -> None:
    diffuse = tuple(scene(f"m{k}", 1.0, 1.0, model="lambert") for k in range(2))
    mixed = (scene("a", 0.2, 0.5, model="ggx"), scene("b", 1.3, 1.2, model="ggx"))
    shares = {g.group.value: g.share for g in all_gains(diffuse + mixed, 0) if g.error == "average"}
    assert "lambert" not in shares
    assert shares["ggx"].value == pytest.approx((1 - (0.5 * 1.2) ** 0.5) / (1 - (0.2 * 1.3) ** 0.5))
    assert shares["ggx"].low is None and shares["ggx"].high is None
    assert all_gains((), 0) == () and all_gains((SceneResult(facts("none")),), 0) == ()


def test_tables_have_a_row_for_every_model_and_material_and_escape_names() -> None:
    evil = "<script>alert(1)</script>"
    outcome = outcome_of(
        (scene("a", 0.5, 0.8), scene("b", 0.5, 0.9, model=evil), scene("c", 0.5, 1.0))
    )
    tables = {found.kind: found.table for found in model_tables(outcome)}
    assert [row[0] for row in tables["all"].rows] == [
        "plain SIRFS",
        "mdr",
        "SIRFS on the true diffuse layer",
    ]
    assert [row[:3] for row in tables["material"].rows if row[2] == "mdr"] == [
        (evil, "1", "mdr"),
        ("ggx", "2", "mdr"),
    ]
    assert all(len(row) == len(table.heading) for table in tables.values() for row in table.rows)
    assert tables["material"].rows[0][3] == "0.9; 20 %"
    text = page(outcome, [], [])
    assert "<script" not in text and "&lt;script&gt;" in text and "by material" in text
    assert "By material:" in summary(outcome)


def test_the_command_compares_models_by_material(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    more = (
        "--stages",
        "separation",
        "--models",
        "joint,joint",
        "--scenes",
        "2",
        "--seed",
        "1",
        "--renders",
        "0",
        "--bounds",
        "none",
        "--quiet",
    )
    assert main(["validate", str(dataset), "-o", str(out), *more]) == 0
    content = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert content["settings"]["models"] == ["joint"] and "--models joint" in content["command"]
    scores = {own["facts"]["model"]: own["stages"]["models"]["scores"] for own in content["scenes"]}
    assert set(scores) == {"lambert", "ggx"} and all(
        set(found) == {"plain", "true_diffuse", "joint"} for found in scores.values()
    )
    whole = _figures(content, "all", "all")
    for error in ("average", "height", "normal", "shading", "reflectance", "rs_mse", "light"):
        expected = np.exp(np.mean([np.log(found["joint"][error]) for found in scores.values()]))
        assert whole[f"joint.{error}"]["value"] == pytest.approx(expected)
    assert _figures(content, "material", "lambert")["true_diffuse.average"][
        "value"
    ] == pytest.approx(1)  # nothing to separate there
    assert _figures(content, "material", "ggx")["true_diffuse.average"]["value"] == pytest.approx(
        scores["ggx"]["true_diffuse"]["average"]
    )
    assert "## Models beside plain SIRFS" in (out / "summary.md").read_text(encoding="utf-8")
    assert "reflectance, joint" in (out / "report.html").read_text(
        encoding="utf-8"
    )  # scenes to look at


def _figures(content: dict[str, Any], kind: str, value: str) -> dict[str, Any]:
    """The stage's intervals over a slice, by metric."""
    own = [
        f
        for f in content["figures"]
        if f["stage"] == "models" and f["slice"] == {"kind": kind, "value": value}
    ]
    return {figure["metric"]["name"]: figure["interval"] for figure in own}


def test_without_models_there_is_no_such_stage(dataset: Path, tmp_path: Path) -> None:
    more = (
        "--stages",
        "separation",
        "--scenes",
        "1",
        "--renders",
        "0",
        "--bounds",
        "none",
        "--quiet",
    )
    assert main(["validate", str(dataset), "-o", str(tmp_path / "out"), *more]) == 0
    content = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert (
        content["gains"] == []
        and content["settings"]["models"] == []
        and {f["stage"] for f in content["figures"]} == {"separation"}
    )


@pytest.mark.parametrize("wrong", ["magic", "sirfs", ","])
def test_an_unknown_model_is_refused(
    dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], wrong: str
) -> None:
    assert (
        main(["validate", str(dataset), "-o", str(tmp_path / "out"), "--models", wrong, "--quiet"])
        == 2
    )
    told = capsys.readouterr().err
    assert (
        told.startswith("isc: error: ")
        and told.count("\n") == 1
        and not (tmp_path / "out").exists()
    )


@pytest.mark.parametrize("stage", ["models", CHAIN])
def test_evidence_of_a_broken_bound_is_kept(dataset: Path, tmp_path: Path, stage: str) -> None:
    settings = StageOptions(models=("mdr",))
    options = ValidationOptions(
        stages=(*find_stages(None), models_stage(settings.models)), settings=settings
    )
    folder = sorted(dataset.glob("*/*/scene.json"))[0].parent
    shown = SceneResult(facts("s", folder=folder))
    names = write_evidence(tmp_path / "kept", shown, stage, options, Monitor())
    assert names == (
        ("truth.exr", "models.exr")
        if stage == "models"
        else ("truth.exr", "chain_separation.exr", "chain_sirfs.exr")
    )
    assert all((tmp_path / "kept" / name).is_file() for name in names)
