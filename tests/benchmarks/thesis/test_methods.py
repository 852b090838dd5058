"""The thesis' tables of separations and frameworks, on small painted balls whose layers, shape and
light are known exactly.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks.thesis.drawing.image_maps import (
    crop_image,
    fit_scale,
    light_ball,
    pad_to_aspect,
    signed_error,
)
from benchmarks.thesis.images.subject import Subject
from benchmarks.thesis.items import characteristics, removal, segmentation, sheets, sparse_coding
from benchmarks.thesis.measuring import framework_runs, separation_scores
from benchmarks.thesis.measuring.context import Context
from benchmarks.thesis.measuring.framework_runs import AFTER, BOUND, SIRFS
from benchmarks.thesis.measuring.separation_scores import (
    NOTHING,
    SeparationScores,
    SeparatorSetting,
)
from benchmarks.thesis.report import layer_tables
from benchmarks.thesis.report.comparing import (
    judge_reduction,
    object_of_kind,
    paired_ratio,
    rank_sum_p,
)
from benchmarks.thesis.report.layer_tables import DIFFUSE, SPECULAR
from isc_core.datasets.mit_berkeley import MitBerkeleyObject
from isc_core.errors import InputError
from isc_core.evaluation.evaluate import Ratio
from isc_core.evaluation.metrics import score, truth_normal
from isc_core.scene.decomposition import Separation
from isc_core.shading.spherical_harmonics import light_from_reference, light_to_reference, real_sh

pytestmark = pytest.mark.slow  # they share a run

SIZE = 36
PAINTS = ((0.8, 0.25, 0.1), (0.15, 0.45, 0.7))


def painted_ball(name: str, kind: str, paint: tuple[float, float, float], gloss: float) -> Subject:
    """A ball under one smooth light; a highlight above its middle."""
    axis = (np.arange(SIZE) - (SIZE - 1) / 2) / (0.45 * SIZE)
    distance = np.hypot(axis, axis[:, None])
    mask = distance < 0.97
    height = np.where(mask, np.sqrt(np.maximum(1 - distance**2, 0)) * 0.45 * SIZE, np.nan)
    normal = truth_normal(height)
    light = np.zeros((9, 3))
    light[0], light[1], light[2] = -2.5, 0.5, 0.8
    shading = np.where(np.isfinite(normal), np.exp(real_sh(np.nan_to_num(normal)) @ light), 0.5)
    diffuse = np.where(mask[..., None], np.array(paint) * shading, 0).astype(np.float32)
    lobe = gloss * np.exp(-((axis[:, None] + 0.35) ** 2 + axis**2) / 0.02)[..., None] * np.ones(3)
    specular = np.where(mask[..., None], lobe, 0).astype(np.float32)
    image = diffuse + specular
    reflectance = np.where(mask[..., None], np.array(paint), 0.0)
    truth = MitBerkeleyObject(
        name,
        "laboratory",
        image.astype(float),
        mask & (image > 0).all(-1),
        mask,
        height,
        shading,
        reflectance,
        light_to_reference(light),
    )
    return Subject(name, kind, image, mask, diffuse, specular, truth)


@dataclass(frozen=True)
class Balls(Context):
    """A run on two balls of each kind."""

    def subjects(self, kind: str) -> tuple[Subject, ...]:
        """Red and blue."""
        return tuple(
            painted_ball(f"ball {number}", kind, paint, 0 if kind == "diffuse" else 0.4)
            for number, paint in enumerate(PAINTS)
        )

    def photos(self) -> tuple[Subject, ...]:
        """The glossy ones, nothing known."""
        return tuple(
            replace(s, kind="photo", diffuse=None, specular=None, truth=None)
            for s in self.subjects("specular")
        )


@pytest.fixture(scope="module")
def context(tmp_path_factory: pytest.TempPathFactory) -> Context:
    return Balls(tmp_path_factory.mktemp("thesis"), quick=True)


def perfect(subject: Subject) -> Separation:
    diffuse, specular = separation_scores.true_layers(subject)
    return Separation(
        diffuse, specular, np.zeros_like(diffuse), np.ones(subject.mask.shape, np.float32)
    )


@pytest.mark.parametrize("kind", ["specular", "diffuse"])
def test_the_truth_scores_perfectly(context: Context, kind: str) -> None:
    subject = context.subjects(kind)[0]
    found = separation_scores.layer_errors(subject, perfect(subject))
    assert found["mse"] == found["specular_mse"] == 0
    assert found["ssim"] == pytest.approx(1)
    assert found["lmse"] == pytest.approx(0, abs=1e-9)
    assert (
        found["specular_lmse"] is None
        if kind == "diffuse"
        else found["specular_lmse"] == pytest.approx(0, abs=1e-9)
    )
    assert layer_tables.decibels(0) == np.inf


def test_doing_nothing_stands_in_every_table_of_layers_and_is_one(context: Context) -> None:
    for items in (segmentation, removal, sparse_coding):
        for item in items.ITEMS:
            assert item.make is not None
            made = item.make(context)
            of_layers = [
                table for table in made.tables if not table.caption.startswith("Runs that")
            ]
            assert all(
                NOTHING.label in [cell for row in table.rows for cell in row[:2]]
                for table in of_layers
            ), item.number
    runs = layer_tables.score_settings(context, "specular", ())
    assert layer_tables.relative_error(runs, NOTHING.label, "specular", DIFFUSE, 0) == "1"
    for layer in (DIFFUSE, SPECULAR):
        error = layer_tables.mean_scores(runs[NOTHING.label], layer[0])
        true = {
            s.name: float(np.mean(separation_scores.true_layers(s)[1][s.mask].astype(float) ** 2))
            for s in context.subjects("specular")
        }
        assert error == pytest.approx(
            true, rel=1e-4
        )  # leaving the highlight costs exactly the highlight, in both layers
    bare = layer_tables.score_settings(context, "diffuse", ())
    assert layer_tables.relative_error(bare, NOTHING.label, "diffuse", DIFFUSE, 0) == "0.00"


def test_the_text_of_a_table_says_what_its_figures_say(context: Context) -> None:
    runs = layer_tables.score_settings(context, "diffuse", removal.settings())
    said = removal.accuracy_text(runs)
    for words in ("as published", "improved"):
        removed = [
            float(layer_tables.relative_error(runs, label, "diffuse", DIFFUSE, 0))
            for label in runs
            if label.endswith(words)
        ]
        assert f"{min(removed):.1f} to {max(removed):.1f} % {words}" in said
    assert "remove" not in removal.accuracy_text({NOTHING.label: runs[NOTHING.label]})


def test_every_search_marks_the_pixels_of_the_exact_one(context: Context) -> None:
    subject = context.subjects("specular")[0]
    exact = next(way for way in segmentation.SETTINGS if way.label == "exact search, as published")
    marked = separation_scores.segment_highlights(subject, exact, 0)
    assert 0 < marked.sum() < subject.mask.sum() / 2
    for way in segmentation.SETTINGS[:3]:
        assert (separation_scores.segment_highlights(subject, way, 3) == marked).all(), way.label


def test_runs_are_repeated_with_other_seeds_and_taken_up_again(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    subject = context.subjects("specular")[0]
    way = next(way for way in segmentation.SETTINGS if way.label == "CS, as published")
    first = separation_scores.score_separations(context, subject, way, 3)
    assert [run.run for run in first] == [0, 1, 2]
    assert all(
        run.search is not None and run.seconds is not None and run.search > 0 and run.seconds > 0
        for run in first
    )
    assert all(run.exact for run in first)
    assert segmentation.hit_table(
        {way.label: {subject.name: [first[0], replace(first[1], exact=False)]}}
    ).rows == ((way.label, 2, "50 %"),)
    assert way.options(1) == {"optimiser": "chaotic_clonal", "seed": 1}
    monkeypatch.setattr(
        separation_scores, "separate_subject", lambda *_: pytest.fail("computed again")
    )
    assert separation_scores.score_separations(context, subject, way, 3) == first


def test_a_photo_that_a_method_rejects_is_a_row_with_the_reason(context: Context) -> None:
    subject = context.subjects("specular")[0]
    grey = replace(
        subject, name="grey", image=np.repeat(subject.image.mean(2, keepdims=True), 3, 2)
    )
    way = SeparatorSetting("CS, improved", separation_scores.SEGMENTATION)
    found = separation_scores.score_separations(context, grey, way)
    assert found[0].refused and found[0].mse is None
    table = layer_tables.subject_table(
        {
            NOTHING.label: {"grey": separation_scores.score_separations(context, grey, NOTHING)},
            way.label: {"grey": found},
        },
        "specular",
        DIFFUSE,
    )
    assert table.rows[1][2] == "refused"


def test_a_method_that_refuses_hard_subjects_is_marked_in_every_summary(
    rows: list[framework_runs.FrameworkErrors],
) -> None:
    def scores(label: str, error: float, refused: str = "") -> list[SeparationScores]:
        known = SeparationScores("", label, 0, 0.01)
        if refused:
            return [replace(known, refused=refused)]
        return [replace(known, mse=error, lmse=error, ssim=1 - error, seconds=0.1)]

    runs = {
        NOTHING.label: {"easy": scores("", 0.001), "hard": scores("", 0.1)},
        "always": {"easy": scores("always", 0.001), "hard": scores("always", 0.05)},
        "choosy": {"easy": scores("choosy", 0.001), "hard": scores("choosy", 0, "grey")},
    }
    for table in (
        layer_tables.accuracy_table(runs, "specular", DIFFUSE, 0),
        layer_tables.speed_table(runs, lambda label: "always", 0, "always"),
    ):
        assert [row[0] for row in table.rows] == [
            NOTHING.label, "always", "choosy (refuses 1 of 2)",
        ]  # fmt: skip
    first = rows[0].subject
    fewer = [row for row in rows if (row.subject, row.framework) != (first, BOUND.label)]
    for table in (
        characteristics.relative_error_table(fewer, "balls", 0),
        characteristics._speed(fewer, 0),
    ):
        assert [row[0] for row in table.rows] == [
            "SIRFS", "SIRFS-MBP", f"{BOUND.label} (refuses 1 of 2)",
        ]  # fmt: skip


@pytest.mark.parametrize(
    ("found", "holds"),
    [
        (Ratio(0.80, 0.7, 0.9), "yes"),
        (Ratio(0.95, 0.93, 0.97), "partly"),
        (Ratio(0.93, 0.88, 0.98), "partly"),
        (Ratio(0.99, 0.95, 1.03), "no"),
        (Ratio(1.2, 1.1, 1.3), "no"),
        (Ratio(0.8, 0.6, 1.1), "undetermined"),
        (None, "undetermined"),
    ],
)
def test_a_claim_of_ten_per_cent_holds_only_where_the_interval_says_so(
    found: Ratio | None, holds: str
) -> None:
    verdict = judge_reduction("ten per cent less", 0.1, found, "error")
    assert verdict.holds == holds
    if found == Ratio(0.95, 0.93, 0.97):
        assert "interval" not in verdict.why
    if found == Ratio(0.93, 0.88, 0.98):
        assert "the interval includes the claim" in verdict.why


def test_comparisons_are_paired_and_report_insignificance() -> None:
    found = paired_ratio({"a": 1.0, "b": 2.0, "c": 5.0}, {"a": 2.0, "b": 4.0, "d": 1.0}, 0)
    assert found is not None
    assert found == pytest.approx((0.5, 0.5, 0.5))  # the two subjects that both have, not c and d
    assert paired_ratio({"a": 1.0, "b": 0.0}, {"a": 1.0, "b": 1.0}, 0) is None
    assert rank_sum_p([1, 2], [1, 2]) is None


def test_subjects_that_show_one_object_count_as_one_draw() -> None:
    """Two images of every object tell no more than one: the interval does not become narrower."""
    rng = np.random.default_rng(1)
    errors = {f"object {k}": float(error) for k, error in enumerate(np.exp(rng.normal(size=6)))}
    alone = paired_ratio(errors, dict.fromkeys(errors, 1.0), 0)
    twice = {
        f"{kind} {name}": errors[name] for kind in ("specular", "synthetic") for name in errors
    }
    both = paired_ratio(twice, dict.fromkeys(twice, 1.0), 0, object_of_kind)
    independent = paired_ratio(twice, dict.fromkeys(twice, 1.0), 0)
    assert alone is not None and independent is not None and both == pytest.approx(alone)
    assert independent.high / independent.low < 0.8 * alone.high / alone.low
    one = {"specular apple": 1.0, "synthetic apple": 2.0}
    assert paired_ratio(one, one, 0, object_of_kind) is None


def test_repeated_runs_are_compared_by_ranks() -> None:
    assert rank_sum_p([2, 2, 2], [2, 2, 2]) == 1
    low, high = [1.0, 1.1, 1.2, 1.3, 1.4], [2.0, 2.1, 2.2, 2.3, 2.4]
    chance = rank_sum_p(low, high)
    assert chance is not None and chance < 0.01


@pytest.fixture(scope="module")
def rows(context: Context) -> list[framework_runs.FrameworkErrors]:
    subjects = [
        framework_runs.subjects_with_truth(context, (kind,))[0] for kind in ("specular", "diffuse")
    ]
    return framework_runs.score_frameworks(context, subjects, (SIRFS, AFTER[-1], BOUND))


def test_sirfs_is_what_all_are_relative_to(rows: list[framework_runs.FrameworkErrors]) -> None:
    table = characteristics.relative_error_table(rows, "balls", 0)
    assert table.rows[0] == ("SIRFS", *["1"] * len(framework_runs.METRICS))
    of = {(row.subject.split()[0], row.framework): row for row in rows}
    plain, bound = of["diffuse", "SIRFS"], of["diffuse", BOUND.label]
    assert bound.errors == pytest.approx(
        plain.errors, rel=1e-4
    )  # without a highlight the photo is the diffuse image
    assert all(row.seconds > 0 and row.evaluations > 0 for row in rows)


def test_a_separation_afterwards_changes_reflectance_alone(
    rows: list[framework_runs.FrameworkErrors],
) -> None:
    glossy = {row.framework: row.errors for row in rows if row.subject.startswith("specular")}
    for name in ("height", "normal", "light", "shading"):
        assert glossy["SIRFS-MBP"][name] == pytest.approx(glossy["SIRFS"][name], rel=1e-3)
    assert glossy["SIRFS-MBP"]["reflectance"] < 0.8 * glossy["SIRFS"]["reflectance"]


def test_an_estimate_is_kept_with_its_maps(
    context: Context, rows: list[framework_runs.FrameworkErrors], monkeypatch: pytest.MonkeyPatch
) -> None:
    del rows
    monkeypatch.setattr(framework_runs, "make_runner", lambda *_: pytest.fail("computed again"))
    subject = framework_runs.subjects_with_truth(context, ("specular",))[0]
    answer = framework_runs.run_framework(context, subject, SIRFS).answer
    assert answer is not None and answer.height.shape == subject.mask.shape


def test_the_true_maps_score_perfectly_and_fill_the_first_row_of_a_sheet(context: Context) -> None:
    truth = context.subjects("specular")[0].truth
    assert truth is not None
    light = light_from_reference(truth.light)
    normal = np.nan_to_num(truth_normal(truth.height))
    found = score(
        truth,
        height=np.nan_to_num(truth.height),
        normal=normal,
        shading=truth.shading,
        reflectance=truth.reflectance,
        light=light,
    )
    assert (
        found.height == pytest.approx(0)
        and found.reflectance == pytest.approx(0)
        and found.light == pytest.approx(0)
    )
    assert found.normal == pytest.approx(0, abs=1e-6)


def test_figures_are_numbered_without_a_gap_and_none_is_drawn_twice() -> None:
    assert [item.number for item in sheets.ITEMS] == [f"4.{number}" for number in range(10, 49)]
    assert len({item.title for item in sheets.ITEMS}) == 39
    subjects = [painted_ball(name, "specular", PAINTS[0], 0.4) for name in "ab"]
    shown = [sheets.subject_for_figure(index, subjects, 2) for index in range(4)]
    assert [(subject.name, which) for subject, which in shown] == [
        ("a", 0),
        ("b", 0),
        ("a", 1),
        ("b", 1),
    ]
    for few in ([], subjects):
        with pytest.raises(InputError, match="too few"):
            sheets.subject_for_figure(4, few, 2)


def test_sheets_have_a_row_for_the_truth_and_for_each_method(context: Context) -> None:
    made = {item.number: item.make for item in sheets.ITEMS}
    pictures = []
    for number in (
        "4.16",
        "4.18",
    ):  # the first subject as published, and, as there are only two, improved
        make = made[number]
        assert make is not None
        (figure,) = make(context).figures
        assert len(figure.axes) == 5 * 3
        pictures.append(
            np.concatenate(
                [
                    np.ravel(np.asarray(axes.images[0].get_array()))
                    for axes in figure.axes
                    if axes.images
                ]
            )
        )
    assert pictures[0].shape != pictures[1].shape or (pictures[0] != pictures[1]).any()


def test_errors_are_orange_where_light_was_left_and_blue_where_too_much_was_taken() -> None:
    mask = np.ones((3, 5), bool)
    pictures = {
        sign: signed_error(np.full((3, 5, 3), 0.2 * sign), mask, 1.0) for sign in (-1, 0, 1)
    }
    assert (pictures[1][..., 0] > pictures[1][..., 2]).all()
    assert (pictures[-1][..., 0] < pictures[-1][..., 2]).all()
    assert np.ptp(pictures[0]) == 0


def test_pictures_are_cut_to_the_object_and_compared_at_one_scale() -> None:
    mask = np.zeros((20, 30), bool)
    mask[5:10, 4:24] = True
    truth = np.random.default_rng(0).random((20, 30, 3))
    assert crop_image(truth, mask).shape == (5, 20, 3)
    assert fit_scale(0.3 * truth, truth, mask) == pytest.approx(truth)
    picture, covered = light_ball(np.zeros((9, 3)))
    assert picture[covered] == pytest.approx(1)
    wide = pad_to_aspect(picture, mask)
    assert wide.shape[1] == 4 * wide.shape[0]


def test_every_number_of_the_tables_is_there_once() -> None:
    def numbers() -> Iterator[str]:
        for module in (
            segmentation,
            removal,
            sparse_coding,
            characteristics,
        ):
            yield from (item.number for item in module.ITEMS)

    assert list(itertools.chain(numbers())) == [f"4.{number}" for number in range(5, 23)]
