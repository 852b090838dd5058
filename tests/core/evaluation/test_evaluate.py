"""The evaluation's bookkeeping, on a small data set that the tests write themselves."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import scipy.io

from isc_core.baselines import retinex
from isc_core.datasets.mit_berkeley import MitBerkeleyObject, load_natural_lights, load_object
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import LightPrior, Settings, ShapePrior
from isc_core.errors import Cancelled, InputError
from isc_core.evaluation.evaluate import Estimate, EvaluationReport, evaluate, paired_bootstrap
from isc_core.evaluation.metrics import truth_normal
from isc_core.evaluation.runner import Protocol, RunnerOptions, make_runner
from isc_core.photo import Photo, PhotoSource
from isc_core.progress import Monitor
from isc_core.shading.spherical_harmonics import light_from_reference, reference_basis
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from tests.core.small_solves import small_solves


def write_set(root: Path) -> Path:
    """Two domes under both lights, in the layout and the formats of the real set."""
    rows, columns = np.mgrid[:40, :44].astype(float)
    for seed, name in enumerate(("ball", "bowl")):
        rng = np.random.default_rng(seed)
        inside = np.hypot(rows - 20, columns - 22) < 15
        height = np.where(
            inside, (8 - 4 * seed) * np.cos(np.hypot(rows - 20, columns - 22) / 14), np.nan
        )
        normal = np.nan_to_num(truth_normal(height), nan=0.57)
        reflectance = rng.uniform(0.2, 0.9, (40, 44, 3)) * inside[..., None]
        for illumination in ("natural", "laboratory"):
            folder = root / illumination / name
            folder.mkdir(parents=True)
            light = rng.normal(size=(9, 3)) * 0.2 - np.eye(9, 3)
            shading = np.minimum(np.exp(reference_basis(normal) @ light), 1) * inside[..., None]
            images = {
                "diffuse": shading * reflectance,
                "reflectance": reflectance,
                "shading_color": shading,
                "mask": inside,
            }
            if illumination == "laboratory":
                images["original"] = images["diffuse"] + 0.05 * inside[..., None]
            for file, image in images.items():
                stored = np.round(np.minimum(image, 1) * 65535).astype(np.uint16)
                assert cv2.imwrite(
                    str(folder / f"{file}.png"), stored[:, :, ::-1] if stored.ndim == 3 else stored
                )
            scipy.io.savemat(folder / "shading_corrected_color.mat", {"shading_correct": shading})
            scipy.io.savemat(folder / "L.mat", {"L": light, "color_lights": {"diffuse": light}})
            scipy.io.savemat(folder / "Z.mat", {"depth": height})
            scipy.io.savemat(
                folder / "crop_idx.mat",
                {"crop_idx1": np.arange(3, 39), "crop_idx2": np.arange(4, 43)},
            )
    return root


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_set(tmp_path_factory.mktemp("set"))


def oracle(truth: MitBerkeleyObject, monitor: Monitor) -> Estimate:
    monitor.report("looking it up", 0.5)
    return Estimate(
        height=np.nan_to_num(truth.height),
        normal=np.nan_to_num(truth_normal(truth.height)),
        shading=truth.shading,
        reflectance=truth.reflectance,
        light=light_from_reference(truth.light),
        loss=1.25,
    )


def naive(truth: MitBerkeleyObject, monitor: Monitor) -> Estimate:
    del monitor
    flat = np.broadcast_to([0.0, 0.0, 1.0], truth.image.shape)
    return Estimate(
        np.zeros(truth.height.shape),
        flat,
        np.ones(truth.image.shape),
        truth.image,
        np.zeros((9, 3)),
    )


def test_a_baseline_is_scored_on_its_own_shading(root: Path) -> None:
    """Not on what second-order light on its rough normals makes of it."""
    truth = load_object(root, "ball", "natural")
    answer = make_runner(RunnerOptions("retinex"), shipped_prior_set())(truth, Monitor())
    own = retinex.log_shading(np.log(np.where(truth.valid[..., None], truth.image, 1)), truth.valid)
    np.testing.assert_allclose(answer.shading[truth.valid], np.exp(own[truth.valid]))
    np.testing.assert_allclose(
        (answer.shading * answer.reflectance)[truth.valid], truth.image[truth.valid]
    )


@pytest.mark.slow
@pytest.mark.parametrize("model", ["mdr", "joint"])
def test_without_removed_light_the_result_is_that_of_plain_sirfs(root: Path, model: str) -> None:
    """To the bit: the layers are stored in fewer digits than the set's images, and SIRFS' many
    minima would show that.
    """
    truth = load_object(root, "ball", "natural")
    plain, other = (
        make_runner(RunnerOptions(name, "none"), shipped_prior_set())(truth, Monitor())
        for name in ("sirfs", model)
    )
    np.testing.assert_array_equal(other.height, plain.height)
    np.testing.assert_array_equal(other.reflectance, plain.reflectance)


@pytest.mark.slow
def test_the_users_protocol_measures_decompose_itself(root: Path) -> None:
    truth = load_object(root, "ball", "natural")
    options = RunnerOptions("sirfs", threads=1, protocol=Protocol.USERS)
    found = make_runner(options, shipped_prior_set())(truth, Monitor())
    source = PhotoSource("", truth.mask.shape[::-1], 16, "linear", "file")
    clipped = np.zeros_like(truth.mask)
    photo = Photo(truth.image.astype(np.float32), truth.mask, 1 / 65535, clipped, source)
    result = decompose(photo, Settings("sirfs", illumination="natural", threads=1, full_size=True))
    for name in ("height", "normal", "shading", "reflectance"):
        np.testing.assert_array_equal(getattr(found, name), getattr(result, name))
    np.testing.assert_array_equal(found.light, result.illumination)
    assert found.loss == result.provenance.diagnostics.loss
    reference = make_runner(RunnerOptions("sirfs", threads=1), shipped_prior_set())
    assert not np.allclose(reference(truth, Monitor()).height, found.height, atol=0.1)
    baseline = make_runner(replace(options, model="retinex"), shipped_prior_set())
    assert np.isfinite(baseline(truth, Monitor()).height).all()
    report = evaluate(
        root,
        objects=["ball"],
        illuminations=["natural"],
        model="sirfs",
        protocol=Protocol.USERS,
        runner=lambda *_: found,
    )
    assert json.loads(json.dumps(report.to_json()))["protocol"] == "users"


def test_old_names_of_priors_are_still_read(root: Path) -> None:
    old, new = Settings(light_prior="usual", shape_prior="outline"), Settings()
    assert (old.light_prior, old.shape_prior) == (LightPrior.DATASET, ShapePrior.SILHOUETTE)
    assert Settings(light_prior="seen", shape_prior="seen") == new


@pytest.mark.slow
def test_predictions_are_used_if_the_settings_say_so(root: Path) -> None:
    def height(illumination: str, **priors: str) -> np.ndarray:
        options = RunnerOptions(threads=1, **priors)  # type: ignore[arg-type]
        return make_runner(options, shipped_prior_set())(
            load_object(root, "ball", illumination), Monitor()
        ).height

    with small_solves():
        for illumination in ("natural", "laboratory"):
            by_itself = height(illumination)
            np.testing.assert_array_equal(height(illumination), by_itself)
            for prior in ("light_prior", "shape_prior"):
                assert not np.array_equal(height(illumination, **{prior: "predicted"}), by_itself)
    with pytest.raises(InputError, match="unknown shape prior"):
        RunnerOptions(shape_prior="round").check()


@pytest.fixture(scope="module")
def report(root: Path) -> EvaluationReport:
    return evaluate(root, model="naive", runner=naive)


def test_runs_every_object_under_every_light(report: EvaluationReport) -> None:
    assert [(r.illumination, r.name) for r in report.results] == [
        ("natural", "ball"), ("natural", "bowl"), ("laboratory", "ball"), ("laboratory", "bowl"),
    ]  # fmt: skip
    assert report.illuminations == ("natural", "laboratory")
    assert all(
        r.scores.average > 1e-4 and r.loss is None and r.valid_pixels > 500 for r in report.results
    )


def test_the_oracle_is_perfect_and_the_naive_answer_is_not(
    root: Path, report: EvaluationReport
) -> None:
    perfect = evaluate(
        root, objects=["bowl"], illuminations=["natural"], model="oracle", runner=oracle
    )
    assert len(perfect.results) == 1 and perfect.results[0].loss == 1.25
    assert perfect.mean("natural").average < 1e-7 < report.mean("natural").average


def test_means_are_geometric(report: EvaluationReport) -> None:
    a, b = (r.scores for r in report.under("laboratory"))
    mean = report.mean("laboratory")
    assert mean.height == pytest.approx(np.sqrt(a.height * b.height))
    assert mean.average == pytest.approx(np.sqrt(a.average * b.average))


def test_json_has_the_names_of_the_reference(report: EvaluationReport) -> None:
    stored = json.loads(json.dumps(report.to_json(), allow_nan=False))
    names = {"height", "normal", "shading", "reflectance", "rs_mse", "light", "avg"}
    assert (
        set(stored["geometric_means"])
        == set(stored["results"])
        == {"natural/diffuse", "laboratory/diffuse"}
    )
    assert set(stored["geometric_means"]["natural/diffuse"]) == names | {"seconds"}
    ball = stored["results"]["natural/diffuse"]["ball"]
    assert names | {"final_loss", "evaluations", "valid_pixels", "seconds"} == set(ball)
    assert ball["avg"] == report.results[0].scores.average


def test_table_is_aligned_and_complete(report: EvaluationReport) -> None:
    lines = report.table().splitlines()
    assert len(lines) == 2 + 2 * 3 and len({len(line) for line in lines}) == 1
    assert sum("geometric mean" in line for line in lines) == 2
    assert f"{report.results[0].scores.height:.2f}" in lines[2]


def test_original_input_shows_the_highlights(root: Path, report: EvaluationReport) -> None:
    original = evaluate(
        root, illuminations=["laboratory"], input="original", model="naive", runner=naive
    )
    assert (
        original.results[0].scores.reflectance != report.under("laboratory")[0].scores.reflectance
    )
    assert "laboratory/original" in original.to_json()["results"]


def test_natural_light_has_highlights_where_the_set_was_given_some(tmp_path: Path) -> None:
    root = write_set(tmp_path)
    for name in ("ball", "bowl"):
        (root / "natural" / name / "original.png").write_bytes(
            (root / "natural" / name / "diffuse.png").read_bytes()
        )
    glossy = evaluate(
        root, illuminations=["natural"], input="original", model="naive", runner=naive
    )
    assert [result.name for result in glossy.results] == ["ball", "bowl"]


@pytest.mark.parametrize("light", ["natural", "natural-area", "laboratory"])
@pytest.mark.parametrize("kind", ["original", "diffuse"])
def test_a_glossy_set_is_evaluated_once_under_its_own_light(
    tmp_path: Path, light: str, kind: str
) -> None:
    """Its laboratory and natural folders have the same images, for readers of either half."""
    root = write_set(tmp_path)
    record = {"kind": "isc synth glossy-mit", "light": light}
    (root / "scene.json").write_text(json.dumps(record), encoding="utf-8")
    for name in ("ball", "bowl"):
        for half in ("natural", "laboratory"):
            images = root / half / name
            (images / "original.png").write_bytes((images / "diffuse.png").read_bytes())
    found = evaluate(root, input=kind, model="naive", runner=naive)
    assert found.illuminations == (light.partition("-")[0],) and len(found.results) == 2


def test_bad_names_are_found_before_the_first_run(root: Path) -> None:
    def never(truth: MitBerkeleyObject, monitor: Monitor) -> Estimate:
        raise AssertionError("must not run")

    wrong: tuple[dict[str, Any], ...] = (
        {"objects": ["ball", "cube"]},
        {"input": "original", "illuminations": ["natural"]},
        {"illuminations": ["dusk"]},
        {"objects": []},
    )
    for options in wrong:
        with pytest.raises(InputError):
            evaluate(root, model="never", runner=never, **options)


@pytest.mark.parametrize(
    ("file", "values", "told"),
    [
        ("laboratory/bowl/Z.mat", {"depth": np.full((40, 44), np.nan)}, "known height"),
        ("natural/bowl/L.mat", {"L": np.full((9, 3), 500.0)}, "its light"),
        ("laboratory/bowl/reflectance.png", None, "reflectance has a channel"),
        (
            "laboratory/bowl/shading_corrected_color.mat",
            {"shading_correct": np.full((40, 44, 3), np.nan)},
            "shading has values that are not finite",
        ),
    ],
)
def test_truth_that_cannot_be_scored_is_found_before_the_first_run(
    tmp_path: Path, file: str, values: dict[str, np.ndarray] | None, told: str
) -> None:
    def never(truth: MitBerkeleyObject, monitor: Monitor) -> Estimate:
        raise AssertionError("must not run")

    path = write_set(tmp_path) / file
    if values is None:
        assert cv2.imwrite(str(path), np.zeros((40, 44, 3), np.uint16))
    else:
        scipy.io.savemat(path, values)
    with pytest.raises(InputError, match=f"^bowl, .*{told}"):
        evaluate(tmp_path, model="never", runner=never)


def test_lights_that_are_not_finite_are_refused_by_file(tmp_path: Path) -> None:
    root = write_set(tmp_path)
    scipy.io.savemat(root / "natural" / "bowl" / "L.mat", {"L": np.full((9, 3), np.nan)})
    scipy.io.savemat(root / "natural_lights.mat", {"Ls": np.full((9, 3, 4), np.inf)})
    with pytest.raises(InputError, match=r"bowl.L\.mat: .* not finite"):
        load_object(root, "bowl", "natural")
    with pytest.raises(InputError, match=r"natural_lights\.mat: .* not finite"):
        load_natural_lights(root)


def test_a_name_given_twice_counts_once(root: Path) -> None:
    assert (
        len(
            evaluate(
                root,
                objects=["ball", "ball"],
                illuminations=["natural"],
                model="naive",
                runner=naive,
            ).results
        )
        == 1
    )


def test_progress_rises_and_cancelling_stops(root: Path) -> None:
    seen: list[tuple[str, float]] = []
    evaluate(
        root,
        objects=["ball"],
        model="oracle",
        runner=oracle,
        monitor=Monitor(lambda event: seen.append((event.stage, event.fraction))),
    )
    fractions = [f for _, f in seen]
    assert fractions == [0, 0.25, 0.5, 0.75, 1] and "ball" in seen[0][0]
    with pytest.raises(Cancelled):
        evaluate(root, model="oracle", runner=oracle, monitor=Monitor(cancelled=lambda: True))


def test_the_bootstrap_interval_of_a_constant_ratio_has_no_width() -> None:
    b = np.log([1.0, 2.0, 5.0, 9.0])
    assert paired_bootstrap(b + np.log(0.8), b, 0) == pytest.approx((0.8, 0.8, 0.8))


def test_bootstrap_covers_and_repeats() -> None:
    rng = np.random.default_rng(0)
    base = rng.normal(size=10)
    better = base + rng.normal(-0.3, 0.2, size=10)
    found = paired_bootstrap(better, base, 3)
    assert found == paired_bootstrap(better, base, 3) != paired_bootstrap(better, base, 4)
    assert found.low < found.ratio < found.high < 1
    assert found.ratio == pytest.approx(np.exp((better - base).mean()))
    swapped = paired_bootstrap(base, better, 3)
    assert (1 / swapped.ratio, 1 / swapped.high, 1 / swapped.low) == pytest.approx(found, rel=1e-9)
    # The width is that of a mean of ten: about 2 * 1.96 * .2 / sqrt(10) in logarithms.
    assert np.log(found.high / found.low) == pytest.approx(
        2 * 1.96 * np.std(better - base) / np.sqrt(10), rel=0.1
    )


def test_bootstrap_refuses_unpaired_values() -> None:
    for a, b in (([1.0], [1.0]), ([1.0, 2.0], [1.0, 2.0, 3.0]), ([1.0, -np.inf], [1.0, 2.0])):
        with pytest.raises(ValueError, match="paired"):
            paired_bootstrap(a, b, 0)
