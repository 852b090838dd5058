"""The thesis' tables of thresholds: exact rows against all candidates, statistics against their
definitions, items as they are made.
"""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks.separation.thresholding import COUNTS, IMAGES
from benchmarks.thesis.items.thresholds import (
    _more_often,
    _speed_verdict,
    exhaustive_search,
)
from benchmarks.thesis.measuring.context import Context
from benchmarks.thesis.measuring.threshold_runs import (
    ThresholdRuns,
    count_iterations,
    holm_correction,
    image_objective,
    rank_sum_test,
    run_searches,
    threshold_runs,
    wilson_interval,
)
from benchmarks.thesis.registry import find_item
from benchmarks.thesis.report.claims import CHAOS_FINDS_OPTIMUM, CHAOS_HELPS
from benchmarks.thesis.report.item import ItemContent
from isc_core.thresholding import OtsuObjective, exact


@pytest.fixture(scope="module")
def context(tmp_path_factory: pytest.TempPathFactory) -> Context:
    return Context(tmp_path_factory.mktemp("thesis"), quick=True)


def made(context: Context, kind: str, number: str) -> ItemContent:
    item = find_item(kind, number)
    assert item.make is not None
    return item.make(context)


def test_all_candidates_agree_with_dynamic_programming() -> None:
    """On few levels against a plain loop, on a real image against the program for it."""
    rng = np.random.default_rng(3)
    few = OtsuObjective(np.concatenate([rng.integers(1, 50, 12), np.zeros(244)]))
    loop = max(float(few(np.array([sets]))[0]) for sets in combinations(range(12), 3))
    assert exhaustive_search(few)[1] == pytest.approx(loop, rel=1e-12)
    for name in ("camera", "clock"):
        where, value = exhaustive_search(image_objective(name))
        assert value == pytest.approx(exact(image_objective(name), 3).value, rel=1e-12)
        assert image_objective(name)(np.array([where]))[0] == pytest.approx(value, rel=1e-12)


def test_the_exact_table_has_every_image_and_its_known_optimum(context: Context) -> None:
    table, check = made(context, "table", "4.1").tables
    known = {(row[0], row[1]): float(row[3]) for row in table.rows}
    assert known["camera", 4] == pytest.approx(5313.813, abs=1e-3)
    assert "46 100 145 182" in {row[2] for row in table.rows}
    assert set(known) == {(name, count) for name in IMAGES[:3] for count in COUNTS}
    assert all(0 < float(row[4]) < 100 for row in table.rows) and {
        row[3] for row in check.rows
    } == {"yes"}
    # More classes never lie closer together.
    assert all(known[name, 3] < known[name, 4] < known[name, 5] for name in IMAGES[:3])


@pytest.mark.slow
def test_runs_are_kept_differ_by_seed_and_never_beat_the_optimum(context: Context) -> None:
    found = run_searches(context, ("PSO", "CS"))
    for (_, image, count), each in found.items():
        best = exact(image_objective(image), count).value
        assert (each.values <= best * (1 + 1e-12)).all() and each.thresholds.shape == (
            len(each.values),
            count,
        )
        assert each.values == pytest.approx(image_objective(image)(each.thresholds), rel=1e-12)
        assert np.array_equal(np.isfinite(each.needed), each.values >= best * (1 - 1e-12))
    before = {path: path.stat().st_mtime_ns for path in context.output.rglob("*.jsonl")}
    threshold_runs(Context(context.output, quick=True), "PSO", "camera", 5)
    assert before and before == {
        path: path.stat().st_mtime_ns for path in context.output.rglob("*.jsonl")
    }, "they were computed anew"
    assert len(set(found["PSO", "camera", 5].values.tolist())) > 1, "every run started alike"


@pytest.mark.slow
def test_tables_of_runs_fit_the_runs(context: Context) -> None:
    objectives, thresholds, times = (
        made(context, "table", number) for number in ("4.2", "4.3", "4.4")
    )
    assert [verdict.claim for verdict in objectives.verdicts] == [CHAOS_FINDS_OPTIMUM, CHAOS_HELPS]
    chaotic = run_searches(context, ("CS",))
    hits = sum(each.hits for each in chaotic.values())
    assert (
        f"{hits} of {sum(len(each.values) for each in chaotic.values())} runs"
        in objectives.verdicts[0].here
    )
    cells = {(row[0], row[1]): row for row in objectives.tables[1].rows}
    assert cells["moon", 4][7] == f"{chaotic['CS', 'moon', 4].values.mean():.3f}"
    assert all(len(table.rows) == 9 for table in (*thresholds.tables, *times.tables))
    assert all(0 <= float(row[-1]) <= 1 for row in times.tables[0].rows)


@pytest.mark.parametrize("number", ["3.5", "3.6", "3.7", "3.8", "4.1"])
def test_figures_are_drawn(context: Context, number: str) -> None:
    answer = made(context, "figure", number)
    assert len(answer.figures) == 1 and answer.tables[0].rows and answer.text


def test_uniform_numbers_and_one_orbit_are_distinguished(context: Context) -> None:
    one, many, pseudo = (
        [float(cell) for cell in row[1:]] for row in made(context, "figure", "3.8").tables[0].rows
    )
    assert many[2] == pseudo[2] == 0 < one[2]
    assert many[0] < 100 and pseudo[0] < 100


def test_intervals_and_tests_equal_known_values() -> None:
    assert np.allclose(wilson_interval(50, 50), (0.92866, 1), atol=1e-4)
    assert np.allclose(wilson_interval(5, 10), (0.23659, 0.76341), atol=1e-4)
    assert holm_correction([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert rank_sum_test(np.array([1.0, 1.0]), np.array([1.0, 1.0])) == (0.5, 1.0)
    share, p = rank_sum_test(np.array([np.inf] * 20), np.arange(20.0))
    assert share == 1.0 and p < 1e-6
    assert count_iterations("PSO", np.array([40, 41, 80, 120])).tolist() == [0, 1, 1, 2]
    assert count_iterations("CS", np.array([50, 51, 305, 306])).tolist() == [0, 1, 1, 2]


@pytest.mark.parametrize(
    ("swarm", "plain", "chaotic", "holds", "why"),
    [
        (100, 100, 150, "yes", ""),
        (100, 150, 150, "partly", "so does plain ClonalG"),
        (120, 135, 146, "partly", "It beats PSO, but not ClonalG"),
        (150, 100, 150, "partly", "It beats ClonalG, but not PSO"),
        (148, 150, 150, "undetermined", "Too few runs"),
        (150, 150, 150, "no", "no more often"),
        (150, 150, 100, "no", "no more often"),
    ],
)
def test_more_successful_is_judged_against_both_other_searches(
    swarm: int, plain: int, chaotic: int, holds: str, why: str
) -> None:
    found, words = _more_often({"PSO": swarm, "ClonalG": plain, "CS": chaotic}, 150)
    assert found == holds and why in words and bool(words) == bool(why)


@pytest.mark.parametrize(
    ("swarm", "plain", "holds", "why"),
    [
        (2000, 2000, "yes", ""),
        (-2000, 2000, "partly", "faster than ClonalG. CS is slower than PSO."),
        (-2000, 0, "no", "CS and ClonalG cannot be told apart. CS is slower than PSO."),
        (-2000, -2000, "no", "slower than ClonalG. CS is slower than PSO."),
        (np.inf, np.inf, "yes", ""),
    ],
)
def test_faster_is_judged_against_both_other_searches(
    swarm: float, plain: float, holds: str, why: str
) -> None:
    chaotic = 4000 + np.arange(50.0)
    found = {
        (search, "camera", 3): ThresholdRuns(needed, needed, np.zeros((50, 3)))
        for search, needed in (
            ("CS", chaotic), ("ClonalG", chaotic + plain), ("PSO", chaotic + swarm)
        )
    }  # fmt: skip
    verdict = _speed_verdict(found, [("camera", 3)], np.array([0.5]))
    assert verdict.holds == holds and why in verdict.why and bool(verdict.why) == bool(why)
    assert "nan" not in verdict.here


@pytest.mark.slow
def test_another_seed_is_another_run(context: Context, tmp_path: Path) -> None:
    one, other = (
        threshold_runs(Context(tmp_path, quick=True, seed=seed), "PSO", "camera", 5)
        for seed in (0, 100)
    )
    assert not np.array_equal(one.thresholds, other.thresholds)
