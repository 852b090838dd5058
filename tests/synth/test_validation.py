"""Scores, budgets and intervals of a validation, on scenes with known results."""

import json
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.evaluation.metrics import Scores
from isc_core.imaging.framing import continued_height
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from isc_core.shading.spherical_harmonics import real_sh
from synth.capture.sensor import Sensor, observe
from synth.capture.truth import GroundTruth
from synth.dataset.reading import SceneFacts
from synth.validation.checks.render_checks import check_identities
from synth.validation.measurement.bootstrap import Interval, mean_interval
from synth.validation.measurement.bounds import (
    FEWEST,
    Bound,
    bounds_from,
    judge,
    read_bounds,
    write_bounds,
)
from synth.validation.measurement.figures import CHAIN, Figure, all_figures, scene_value
from synth.validation.measurement.measure import (
    SceneResult,
    StageResult,
    measure_scene,
    side_by_side,
)
from synth.validation.measurement.slices import EVERYTHING, Slice, all_slices
from synth.validation.measurement.substitution import (
    COMBINATIONS,
    METRICS,
    TRUTHS,
    ChainScores,
    budget,
    chain_value,
)
from synth.validation.stages.registry import all_stages, find_stages
from synth.validation.stages.separation import SEPARATION, SeparationScores, score_separation
from synth.validation.stages.sirfs import SIRFS, run_sirfs, score_sirfs, show_sirfs, with_normals
from synth.validation.stages.types import Metric, StageOptions, stage_inputs

SIZE = 40


def sphere(share: float = 0.3, grey: bool = False) -> GroundTruth:
    """A sphere whose shading is exactly exp(SH(normal)), two colours, and a highlight of `share` of
    white.
    """
    radius = 0.42 * SIZE
    axis = np.arange(SIZE) + 0.5 - SIZE / 2
    x, y = np.meshgrid(axis, -axis)
    z = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0))
    mask = x**2 + y**2 < (0.95 * radius) ** 2
    normal = np.where(mask[..., None], np.stack([x, y, z], -1) / radius, (0, 0, 1))
    light = np.zeros((9, 3))
    light[0], light[1], light[2], light[3] = -2.0, 0.3, 0.5, -0.4
    colors = (
        np.array([[0.5, 0.5, 0.5], [0.2, 0.2, 0.2]])
        if grey
        else np.array([[0.6, 0.2, 0.15], [0.15, 0.3, 0.6]])
    )
    inside = mask[..., None]
    reflectance = np.where(inside, colors[(x + y > 0).astype(int)], 0)
    shading = np.where(inside, np.exp(real_sh(normal) @ light), 0)
    specular = np.where(
        inside,
        share * np.maximum(normal @ np.array([0.3, 0.4, 0.866]), 0)[..., None] ** 60 * np.ones(3),
        0,
    )
    diffuse, nothing = reflectance * shading, np.zeros((SIZE, SIZE, 3), np.float32)
    flat, height = np.zeros((SIZE, SIZE), np.float32), np.where(mask, z, 0)
    layers = (diffuse + specular, diffuse, specular, nothing, reflectance, shading, normal, height)
    image, diffuse, specular, residual, reflectance, shading, normal, height = (
        np.asarray(layer, np.float32) for layer in layers
    )
    return GroundTruth(
        image,
        diffuse,
        specular,
        residual,
        reflectance,
        shading,
        normal,
        height,
        mask,
        flat,
        flat,
        nothing,
        nothing,
        light,
        0.0,
        np.zeros((4, 8, 3)),
    )


def facts(name: str, **changes: object) -> SceneFacts:
    base = SceneFacts(
        name,
        "train",
        "o",
        "m",
        "l",
        "patches",
        "ggx",
        "sharp",
        "point",
        0.1,
        900,
        0,
        Path("nowhere"),
    )
    return replace(base, **changes)


def chain(error: dict[frozenset[str], float]) -> ChainScores:
    """A scene whose every error, under the ground truths S, is `error[S]`."""
    scores = tuple(Scores(*([error[frozenset(truths)]] * 6)) for truths in COMBINATIONS)
    return ChainScores(scores, scores[0], scores[-1], 0.1)


def test_a_perfect_separation_has_no_error() -> None:
    truth = sphere()
    scores = score_separation(
        truth,
        Separation(
            truth.diffuse, truth.specular, truth.residual, np.ones((SIZE, SIZE), np.float32)
        ),
    )
    assert replace(scores, lmse_diffuse=0, lmse_specular=0) == SeparationScores(
        0, 0, 0, 0, 120, 120, 0, None, None
    )
    assert scores.lmse_diffuse == pytest.approx(
        0, abs=1e-30
    ) and scores.lmse_specular == pytest.approx(0, abs=1e-30)


def test_doing_nothing_has_a_ratio_of_one_and_all_highlights_as_error() -> None:
    truth = sphere()
    scores = score_separation(
        truth,
        Separation(truth.image, 0 * truth.image, truth.residual, np.ones((SIZE, SIZE), np.float32)),
    )
    assert scores.mse_ratio == pytest.approx(1, rel=1e-6)
    assert scores.mse_diffuse == pytest.approx(
        np.square(truth.specular[truth.mask].astype(float)).mean(), rel=1e-5
    )
    assert scores.lmse_specular == pytest.approx(1)


def test_a_perfect_confidence_ranks_and_removes_the_error() -> None:
    truth = sphere()
    squared = np.square(truth.specular).mean(axis=2)
    knowing = Separation(truth.image, 0 * truth.image, truth.residual, -squared)
    wrong = replace(knowing, confidence=squared)
    good, bad = score_separation(truth, knowing), score_separation(truth, wrong)
    assert (
        good.rank is not None
        and bad.rank is not None
        and good.removed is not None
        and bad.removed is not None
    )
    assert good.rank < -0.9 and bad.rank > 0.9 and good.removed > 0.9 > 0.1 > bad.removed


def test_on_a_diffuse_scene_only_removed_light_counts() -> None:
    truth = sphere(share=0.0)
    left = Separation(
        truth.diffuse, truth.specular, truth.residual, np.ones((SIZE, SIZE), np.float32)
    )
    assert score_separation(truth, left) == SeparationScores(taken=0.0)
    robbed = score_separation(
        truth, replace(left, diffuse=0.9 * truth.diffuse, specular=0.1 * truth.diffuse)
    )
    assert robbed.taken == pytest.approx(0.1, rel=1e-5) and robbed.mse_ratio is None


def test_noise_is_no_highlight() -> None:
    """A photo with noise of a diffuse scene stays a diffuse scene."""
    truth = sphere(share=0.0)
    noise = np.random.default_rng(0).normal(0, 0.01, truth.image.shape).astype(np.float32)
    noise[~truth.mask] = 0
    photo = replace(truth, image=truth.image + noise, residual=noise)
    left = Separation(
        photo.image,
        np.zeros_like(photo.image),
        np.zeros_like(photo.image),
        np.ones(truth.mask.shape, np.float32),
    )
    assert score_separation(photo, left) == SeparationScores(taken=0.0)


@pytest.mark.parametrize("bits", [0, 8, 16])
def test_only_what_the_sensor_clips_is_clipped(bits: int) -> None:
    """Not light above 1 in a photo without clipping, whose residual is rounding or noise."""
    truth = sphere(share=2.0).brightened(1.1)
    bright = truth.mask & (truth.image > 1.05).any(axis=2)
    rng = np.random.default_rng(0)
    for noise in (0.0, 0.001):
        whole = observe(truth, Sensor(clip=False, noise=noise), rng)
        assert not stage_inputs(whole, ()).clipped.any()
        cut = observe(truth, Sensor(clip=True, noise=noise, bits=bits), rng)
        assert stage_inputs(cut, ()).clipped[bright].all()
        assert not stage_inputs(cut, ()).clipped[(truth.image < 0.95).all(axis=2)].any()


def test_the_exact_answer_has_no_error() -> None:
    truth = sphere()
    inputs = stage_inputs(truth, TRUTHS)
    exact = with_normals(
        inputs, truth.height.astype(float), truth.normal.astype(float), truth.illumination
    )
    scores = score_sirfs(truth, exact)
    assert (
        scores.height == 0
        and max(scores.shading, scores.reflectance, scores.rs_mse, scores.light) < 1e-10
        and scores.normal < 1e-3
    )


def test_with_all_truths_nothing_is_solved_and_only_the_pixel_grid_errs() -> None:
    truth = sphere()
    scores = score_sirfs(
        truth,
        run_sirfs(stage_inputs(truth, TRUTHS), StageOptions(), Monitor(cancelled=lambda: True)),
    )
    assert scores.height == 0 and scores.light < 1e-20
    assert scores.normal < 0.05 and chain_value(scores, "images") < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("grey", [False, True])
def test_what_is_given_is_kept(grey: bool) -> None:
    truth = sphere(grey=grey)
    shape_known = run_sirfs(stage_inputs(truth, ("diffuse", "shape")), StageOptions(), Monitor())
    assert np.array_equal(shape_known.height[truth.mask], truth.height[truth.mask].astype(float))
    light_known = run_sirfs(stage_inputs(truth, ("diffuse", "light")), StageOptions(), Monitor())
    assert np.allclose(light_known.light, truth.illumination, atol=1e-6)
    for answer in (shape_known, light_known):
        remade = (answer.reflectance * answer.shading)[truth.mask]
        assert np.allclose(remade, truth.diffuse[truth.mask], atol=1e-6)
    assert len(show_sirfs(truth, light_known)) == 9


def test_a_plane_is_extended_outside_the_mask_as_a_plane() -> None:
    rows, columns = np.indices((21, 21))
    plane = 0.3 * rows - 0.7 * columns
    mask = (rows > 5) & (rows < 15) & (columns > 5) & (columns < 15)
    found = continued_height(np.where(mask, plane, 99.0), mask)
    assert np.allclose(found[5:16, 5:16], plane[5:16, 5:16])


def test_sirfs_refuses_a_black_image() -> None:
    truth = sphere()
    black = replace(truth, diffuse=0 * truth.diffuse)
    with pytest.raises(InputError, match="black"):
        run_sirfs(stage_inputs(black, ("diffuse",)), StageOptions(), Monitor())
    with pytest.raises(InputError, match="black"):
        score_sirfs(black, run_sirfs(stage_inputs(truth, TRUTHS), StageOptions(), Monitor()))


def test_the_budget_is_the_mean_over_orders_and_adds_up() -> None:
    rng = np.random.default_rng(5)
    sets = [frozenset(truths) for truths in COMBINATIONS]
    scenes = [chain({found: float(rng.uniform(0.1, 1)) for found in sets}) for _ in range(4)]
    found = budget(METRICS[0], scenes, 0)
    error = {
        s: float(np.exp(np.mean([np.log(chain_value(c.under(t), "images")) for c in scenes])))
        for s, t in zip(sets, COMBINATIONS, strict=True)
    }
    for share in found.shares:
        saved = []
        for order in permutations(TRUTHS):
            before = frozenset(order[: order.index(share.truth)])
            saved.append(error[before] - error[before | {share.truth}])
        assert share.share.value == pytest.approx(np.mean(saved) / error[frozenset()])
        assert share.alone.value == pytest.approx(
            error[frozenset({share.truth})] / error[frozenset()]
        )
    assert sum(share.share.value for share in found.shares) + found.rest.value == pytest.approx(1)


def test_a_stage_without_error_has_no_share() -> None:
    scenes = [
        chain({frozenset(t): 0.2 if "diffuse" in t else 0.8 for t in COMBINATIONS})
        for _ in range(3)
    ]
    found = budget(METRICS[0], scenes, 0)
    assert [share.share.value for share in found.shares] == pytest.approx([0.75, 0, 0])
    assert found.rest.value == pytest.approx(0.25) and found.error.value == pytest.approx(0.8)
    assert found.rest.low == pytest.approx(0.25) and found.rest.high == pytest.approx(0.25)


def test_truths_that_hand_an_error_over_have_no_share_of_it() -> None:
    scenes = [chain(dict.fromkeys(map(frozenset, COMBINATIONS), 0.5))]
    players = {
        metric.name: tuple(share.truth for share in budget(metric, scenes, 0).shares)
        for metric in METRICS
    }
    assert players["height"] == ("diffuse", "light") and players["light"] == ("diffuse", "shape")
    assert players["average"] == ("diffuse",) and players["images"] == TRUTHS
    assert budget(METRICS[0], scenes, 0).rest.low is None
    with pytest.raises(ValueError):
        budget(METRICS[0], [], 0)


@pytest.mark.slow
@pytest.mark.parametrize("geometric", [False, True])
def test_intervals_have_the_nominal_coverage(geometric: bool) -> None:
    rng = np.random.default_rng(11)
    held = 0
    for trial in range(300):
        drawn = rng.normal(1.0, 0.5, 30)
        found = mean_interval(
            list(np.exp(drawn) if geometric else drawn),
            geometric=geometric,
            seed=trial,
            resamples=400,
        )
        assert found.low is not None and found.high is not None
        true = np.exp(1.0) if geometric else 1.0
        held += found.low <= true <= found.high
    assert 0.89 < held / 300 < 0.98


def test_means_of_one_scene_have_no_interval_and_zero_stays_zero() -> None:
    assert mean_interval([0.3], geometric=True, seed=0) == Interval(
        pytest.approx(0.3), None, None, 1
    )
    assert mean_interval([0.0, 0.0], geometric=True, seed=0) == Interval(0, 0, 0, 2)
    for bad in ([], [np.nan]):
        with pytest.raises(ValueError):
            mean_interval(bad, geometric=False, seed=0)


def test_every_kind_of_slice_holds_every_scene_once() -> None:
    rng = np.random.default_rng(0)
    scenes = [
        facts(
            f"s{k}",
            gloss_class=("diffuse", "sharp")[k % 2],
            specular_share=float(rng.uniform(0, 0.5)),
            mask_pixels=int(rng.integers(50, 900)),
        )
        for k in range(17)
    ]
    found = all_slices(scenes)
    assert found[0] == Slice(EVERYTHING, EVERYTHING, tuple(range(17)))
    kinds = {group.kind for group in found}
    assert kinds == {
        EVERYTHING,
        "gloss",
        "specular share",
        "mask size",
    }  # what is the same everywhere is no slice
    for kind in kinds:
        assert sorted(k for group in found if group.kind == kind for k in group.members) == list(
            range(17)
        )
    sizes = [
        np.mean([scenes[k].mask_pixels for k in group.members])
        for group in found
        if group.kind == "mask size"
    ]
    assert sizes == sorted(sizes) and len(sizes) == 3


def results(values: list[float | None]) -> list[SceneResult]:
    scores = [
        SeparationScores(0.1, 0.1, 0.1, 0.1, 20.0, 20.0, value, 0.5, -0.5) for value in values
    ]
    return [
        SceneResult(facts(f"s{k}"), (StageResult("separation", found, 0.1),))
        for k, found in enumerate(scores)
    ]


def test_figures_pass_over_scenes_where_a_metric_is_not_defined() -> None:
    found = all_figures((SEPARATION,), results([0.5, None, 0.5]), 0)
    ratio = next(f for f in found if f.metric.name == "mse_ratio" and f.group.kind == EVERYTHING)
    assert ratio.interval.scenes == 2 and ratio.interval.value == pytest.approx(0.5)
    assert (
        scene_value(results([None])[0], "separation", "mse_ratio") is None
        and scene_value(results([0.5])[0], CHAIN, "images") is None
    )


def figure(metric: Metric, low: float, high: float, scenes: int = 9) -> Figure:
    return Figure(
        "separation",
        metric,
        Slice(EVERYTHING, EVERYTHING, tuple(range(scenes))),
        Interval((low + high) / 2, low, high, scenes),
    )


@pytest.mark.parametrize(
    ("name", "low", "high", "limit", "broken"),
    [
        ("mse_ratio", 0.4, 0.6, 0.3, True),
        ("mse_ratio", 0.4, 0.6, 0.5, False),
        ("mse_ratio", 0.4, 0.6, 0.7, False),
        ("psnr_diffuse", 20, 22, 25, True),
        ("psnr_diffuse", 20, 22, 21, False),
        ("psnr_diffuse", 20, 22, 15, False),
    ],
)
def test_a_bound_breaks_only_where_the_whole_interval_is_beyond(
    name: str, low: float, high: float, limit: float, broken: bool
) -> None:
    bound = Bound("separation", name, EVERYTHING, EVERYTHING, limit)
    verdicts = judge([bound], [figure(SEPARATION.metric(name), low, high)])
    assert [verdict.broken for verdict in verdicts] == [broken]
    assert judge([bound], [figure(SEPARATION.metric(name), low, high, FEWEST - 1)]) == ()
    assert (
        judge([replace(bound, stage="none such")], [figure(SEPARATION.metric(name), low, high)])
        == ()
    )


def test_a_run_keeps_its_own_bounds_and_they_survive_the_file(tmp_path: Path) -> None:
    figures = all_figures(
        (SEPARATION,), results(list(np.random.default_rng(1).uniform(0.2, 0.9, 12))), 0
    )
    bounds = bounds_from(figures)
    assert len(bounds) == len(SEPARATION.metrics) - 1  # no scene is diffuse
    write_bounds(tmp_path / "bounds.json", bounds)
    assert read_bounds(tmp_path / "bounds.json") == bounds
    assert not any(verdict.broken for verdict in judge(bounds, figures))
    worse = all_figures((SEPARATION,), results([0.95] * 12), 0)
    assert [verdict.bound.metric for verdict in judge(bounds, worse) if verdict.broken] == [
        "mse_ratio"
    ]


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"schema_version": 99, "bounds": []}',
        '{"schema_version": 1, "bounds": 3}',
        '{"schema_version": 1, "bounds": [{"stage": "separation"}]}',
        '{"schema_version": 1, "bounds": [{"stage": "s", "metric": "m", "kind": "all", '
        '"value": "all", "limit": NaN}]}',
        '{"schema_version": 1, "bounds": [{"stage": "s", "metric": "m", "kind": "all", '
        '"value": 3, "limit": 1}]}',
    ],
)
def test_files_that_hold_no_bounds_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "bounds.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="bounds.json"):
        read_bounds(tmp_path / "bounds.json")


def test_bounds_of_schema_1_are_read_with_the_new_gloss_class(tmp_path: Path) -> None:
    entry = {"stage": "gloss", "metric": "invented", "kind": "gloss", "value": "matt", "limit": 0.1}
    content = {"schema_version": 1, "bounds": [entry]}
    (tmp_path / "bounds.json").write_text(json.dumps(content), encoding="utf-8")
    expected = Bound("gloss", "invented", "gloss", "diffuse", 0.1)
    assert read_bounds(tmp_path / "bounds.json") == (expected,)


def test_identities_hold_and_one_wrong_pixel_is_found() -> None:
    truth = sphere()
    assert all(check.passed for check in check_identities("s", truth))
    truth.specular[20, 20] += 1e-3
    assert [check.passed for check in check_identities("s", truth)] == [False, True]


@pytest.mark.slow
def test_the_chain_runs_every_combination_and_reuses_the_stage_by_itself() -> None:
    found = measure_scene(
        facts("s"), sphere(), all_stages(), StageOptions(separator="none"), Monitor()
    )
    assert found.chain is not None and not found.refused
    assert found.chain.under(("diffuse",)) == found.scores(SIRFS.name)
    assert (
        found.chain.under(()) == found.chain.untouched
    )  # with the separator "none" the photo is the diffuse image
    assert found.chain.under(("diffuse", "shape", "light")).height == 0
    assert len(found.chain.swapped) == 8
    assert (
        measure_scene(
            facts("s"), sphere(), (SEPARATION,), StageOptions(separator="none"), Monitor()
        ).chain
        is None
    )


def test_a_scene_that_a_stage_refuses_is_kept_with_the_reason() -> None:
    truth = sphere()
    found = measure_scene(
        facts("s"), replace(truth, diffuse=0 * truth.diffuse), (SIRFS,), StageOptions(), Monitor()
    )
    assert "black" in found.refused and found.stages == ()


def test_results_do_not_depend_on_the_number_of_threads_and_come_in_order() -> None:
    def task(item: int, monitor: Monitor) -> int:
        monitor.report("", 0)
        return item * item

    assert (
        side_by_side(task, range(20), 1, "x", Monitor())
        == side_by_side(task, range(20), 4, "x", Monitor())
        == tuple(k * k for k in range(20))
    )
    with pytest.raises(Cancelled):
        side_by_side(task, range(3), 2, "x", Monitor(cancelled=lambda: True))


def test_unknown_names_are_refused_with_those_that_there_are() -> None:
    with pytest.raises(InputError, match="separation, sirfs"):
        find_stages(("brdf",))
    with pytest.raises(InputError, match="natural, laboratory"):
        StageOptions(illumination="moon")
    with pytest.raises(InputError, match="isc"):
        StageOptions(separator="magic")
    with pytest.raises(InputError, match="mse_ratio"):
        SEPARATION.metric("none such")
