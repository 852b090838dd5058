"""The thesis' figures of background, framework and applications, and its tables of documentation:
what has to hold in them.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("mitsuba")

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.thesis.images.subject import Subject
from benchmarks.thesis.items import (
    applications,
    background,
    catalogue,
    filters,
    framework,
    introduction,
)
from benchmarks.thesis.measuring import decompositions
from benchmarks.thesis.measuring.context import Context
from benchmarks.thesis.measuring.specular_free_images import KINDS, PHOTO, residual_highlight
from benchmarks.thesis.report.item import ItemContent, ThesisItem
from isc_core.datasets.mit_berkeley import MitBerkeleyObject
from isc_core.decomposition.pipeline import Settings
from isc_core.evaluation.metrics import truth_normal
from isc_core.photo import Photo
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.diagnostics import LobeFitOutcome
from isc_core.scene.lobe_fit import LobeFit
from isc_core.separation.support.filter_statistics import BINS, FILTERS
from isc_core.shading.brdf.phong import Phong
from isc_core.shading.lights import toward
from isc_core.shading.spherical_harmonics import light_to_reference
from tests.core.ball_scene import ball
from tests.core.separation.scenes import glossy_disc

MODULES = (
    introduction,
    background,
    framework,
    filters,
    applications,
    catalogue,
)
ITEMS = {item.name: item for module in MODULES for item in module.ITEMS}


def known_ball(name: str = "ball") -> Subject:
    """The chequered ball, all of it known."""
    d = ball((64, 64), 28.0, (31.5, 31.5))
    height = np.where(d.mask, d.height, np.nan)
    truth = MitBerkeleyObject(
        name,
        "natural",
        d.image.astype(float),
        d.mask,
        d.mask,
        height,
        d.shading.astype(float),
        d.reflectance.astype(float),
        light_to_reference(d.illumination),
    )
    return Subject(name, "synthetic", d.image, d.mask, d.diffuse, d.specular, truth)


@dataclass(frozen=True)
class Known(Context):
    """A run on the ball alone."""

    def subjects(self, kind: str) -> tuple[Subject, ...]:
        """The ball, whatever the kind; without its highlight as a diffuse one."""
        one = known_ball()
        assert one.diffuse is not None
        bare = replace(one, image=one.diffuse, specular=np.zeros_like(one.diffuse))
        return (bare,) if kind == "diffuse" else (one, known_ball("other"))

    def photos(self) -> tuple[Subject, ...]:
        """The ball, of which nothing is known."""
        return (replace(known_ball(), diffuse=None, specular=None, truth=None),)


@pytest.fixture
def context(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Context:
    """A quick run in which the models answer with the ball's truth: what they find has tests of its
    own.
    """
    answer = ball((64, 64), 28.0, (31.5, 31.5))

    def decomposed(*given: object, **also: object) -> Decomposition:
        del given, also
        return answer

    for module in (
        introduction,
        background,
        framework,
        applications,
        catalogue,
    ):
        monkeypatch.setattr(module, "decompose_subject", decomposed)
    monkeypatch.setattr(applications, "DIRECTIONS", applications.DIRECTIONS[:1])
    return Known(tmp_path, quick=True)


def made(name: str, context: Context) -> ItemContent:
    item: ThesisItem = ITEMS[name]
    assert item.make is not None
    return item.make(context)


def column(answer: ItemContent, header: str) -> dict[str, float]:
    """A column of the first table by that of names."""
    place = answer.tables[0].header.index(header)
    return {str(row[0]): float(row[place]) for row in answer.tables[0].rows}


def labels(figure: Figure) -> Iterator[tuple[float, float, float, float]]:
    """Boxes (left, bottom, right, top) of all titles, in pixels."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    for axes in figure.axes:
        if axes.get_title():
            yield axes.title.get_window_extent(canvas.get_renderer()).extents


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name for name in ITEMS if name.startswith("figure") and ITEMS[name].make is not None]
)
def test_figures_are_made_with_their_titles_apart_and_in_the_picture(
    name: str, context: Context
) -> None:
    answer = made(name, context)
    assert answer.figures
    assert answer.text
    for figure in answer.figures:
        assert figure.get_figwidth() == 7.0
        boxes = list(labels(figure))
        right, top = figure.bbox.extents[2:]
        assert all(
            box[0] >= -2 and box[1] >= -2 and box[2] <= right + 2 and box[3] <= top + 2
            for box in boxes
        )
        for one, other in itertools.combinations(boxes, 2):
            overlap = (
                min(one[2], other[2]) - max(one[0], other[0]),
                min(one[3], other[3]) - max(one[1], other[1]),
            )
            assert min(overlap) < 1


def test_what_cannot_be_reproduced_has_a_reason() -> None:
    for name in ("figure-1.1", "figure-3.1"):
        assert ITEMS[name].make is None
        assert len(ITEMS[name].reason) > 20


@pytest.mark.slow
def test_reflectance_models_have_the_properties_in_the_table() -> None:
    found = {name: catalogue.check_constraints(model).obeyed for name, model in catalogue.MODELS}
    assert all(positive for positive, _, _ in found.values())
    reciprocal = {name for name, (_, obeyed, _) in found.items() if obeyed}
    assert set(found) - reciprocal == {name for name in found if "plain" in name}
    keeps = {name: kept for name, (_, _, kept) in found.items()}
    assert keeps["Lambert, albedo 1"]
    assert keeps["GGX, alpha .1, f0 1"]
    assert keeps["Blinn-Phong, conserving, exponent 50"]
    assert not keeps["Blinn-Phong, normalised, exponent 50"]
    assert not keeps["Phong, plain, exponent 1"]


def test_characteristics_are_those_of_a_saved_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert catalogue.check_characteristics(ball(), tmp_path / "all") == ()
    monkeypatch.setattr(catalogue, "CHARACTERISTICS", catalogue.CHARACTERISTICS[1:])
    missing = catalogue.check_characteristics(ball(), tmp_path / "fewer")
    assert any("image" in said for said in missing), "a field that nobody lists is noticed"


@pytest.mark.slow
def test_tables_of_documentation_are_made(context: Context) -> None:
    text = made("table-2.3", context).text
    assert "NOT" not in text and "predicts. Compared with a saved result" in text
    left = column(made("table-2.2", context), "residual highlight (%), mean")
    assert set(left) == {kind.name for kind in KINDS}
    assert len(made("table-2.1", context).tables[0].rows) == len(catalogue.MODELS)


def test_white_highlights_are_not_left_in_the_exact_images() -> None:
    image, diffuse, mask = glossy_disc()
    subject = Subject("disc", "specular", image, mask, diffuse, image - diffuse)
    assert residual_highlight(PHOTO, subject) == pytest.approx(1, abs=0.05)
    for kind in KINDS[:3]:
        assert residual_highlight(kind, subject) < 1e-9


def test_a_lobe_is_largest_where_light_is_mirrored_to() -> None:
    views = np.linspace(-89, 89, 179)
    for incident in (0, 30, 60):
        curve = background.lobe(Phong(exponent=50.0), incident, views) / np.cos(np.deg2rad(views))
        assert views[np.argmax(curve)] == incident
    sharp, _ = background.phong_sphere(48, 100.0)
    soft, mask = background.phong_sphere(48, 5.0)
    assert np.allclose(
        soft["sum"][mask], (soft["ambient"] + soft["diffuse"] + soft["specular"])[mask]
    )
    assert sharp["specular"][mask].sum() < soft["specular"][mask].sum() / 5


def test_smooth_light_is_modelled_better_by_harmonics_than_by_one_lamp() -> None:
    true, models, _ = background.shading_models(known_ball())
    inside = true.any(axis=2)
    smooth, lamp, constant = (
        float(np.square((model - true)[inside]).mean()) for model in models.values()
    )
    assert smooth < 0.1 * lamp
    assert lamp < 0.5 * constant


def test_closed_forms_look_as_their_shape_and_light_say() -> None:
    for shaded in (introduction.sphere(64), introduction.vase(64)):
        inside = np.isfinite(shaded.height)
        assert np.array_equal(inside, shaded.mask)
        normal = truth_normal(shaded.height)
        known = np.isfinite(normal[..., 2]) & (normal[..., 2] > 0.5)
        expected = introduction.ALBEDO * np.maximum(normal @ introduction.LIGHT, 0)
        assert np.abs(expected - shaded.image[..., 0])[known].mean() < 0.02
    ball_, method = introduction.sphere(64), "sfs-ikeuchi-horn"
    assert (
        introduction.recover_shape(ball_, method).mean_angle
        < 0.4 * introduction.recover_shape(ball_, "naive").mean_angle
    )


def test_chance_is_distinguished_from_a_difference() -> None:
    random = np.random.default_rng(2)
    alike = random.dirichlet(np.ones(BINS), (8, 2, len(FILTERS)))
    apart = alike.copy()
    apart[:, 0, :, : BINS // 2] *= 9
    apart /= apart.sum(axis=-1, keepdims=True)
    assert (filters.exchange_test(apart, 0) == pytest.approx(2 / 2**8)) and (
        filters.exchange_test(alike, 0) > 0.02
    ).mean() > 0.7
    assert (
        (filters.total_variation(apart) > filters.total_variation(alike))
        & (filters.total_variation(apart) < 1)
    ).all()
    many = np.concatenate([apart, apart])
    assert (filters.exchange_test(many, 0) <= 4 / 4096).all(), (
        "beyond twelve subjects exchanges are drawn at random"
    )
    named = [f"object {number % 8}" for number in range(16)]
    assert filters.exchange_test(many, 0, named) == pytest.approx(2 / 2**8), (
        "two images of an object tell no more than one"
    )
    assert np.allclose(filters.holm_correction(np.array([0.01, 0.5, 0.02])), [0.03, 0.5, 0.04])


def test_photos_are_decomposed_as_isc_decompose_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[Settings] = []

    def answer(photo: Photo, settings: Settings, **also: object) -> Decomposition:
        del photo, also
        used.append(settings)
        return ball()

    monkeypatch.setattr(decompositions, "decompose", answer)
    known = known_ball()
    for subject in (replace(known, kind="photo", truth=None), known):
        decompositions.decompose_subject(Context(tmp_path), subject)
    assert [each.illumination for each in used] == [Settings().illumination, "natural"]
    assert decompositions.illumination_of(known) == "natural"


def test_samples_keep_the_names_of_their_objects() -> None:
    named = [known_ball(name) for name in ("cup_a", "cup_b")]
    samples = filters.layer_samples(named)
    assert [filters._object_of(sample) for sample in samples] == ["cup_a", "cup_b"]


@pytest.mark.slow
def test_the_light_of_a_ball_is_found_to_a_degree() -> None:
    for direction in (toward(-0.6, 0.6, 1.0), toward(0.9, -0.4, 0.8)):
        found = applications.estimate_directions(applications.render_ball(direction, 40))
        assert len(found) == 3
        for name, light in found.items():
            assert applications.degrees_between(light, direction) < 1, name


def test_edits_change_only_what_was_requested(context: Context) -> None:
    answer = made("figure-4.50", context)
    diffuse, specular = (
        column(answer, f"of the {layer} layer (%)") for layer in ("diffuse", "specular")
    )
    assert diffuse["no edit"] == specular["no edit"] == 0
    for name in diffuse:
        if name != "no edit":
            layers = {"diffuse": diffuse[name], "specular": specular[name]}
            asked = name.split()[0]
            assert layers.pop(asked) > 1, name
            assert set(layers.values()) == {0}, name
    assert diffuse["diffuse removed"] == pytest.approx(100)
    recoloured = made("figure-4.51", context)
    assert set(column(recoloured, "change outside (%)").values()) == {0.0}
    assert set(column(recoloured, "of the highlights (%)").values()) == {0.0}
    assert min(column(recoloured, "change inside (%)").values()) > 1
    assert max(column(recoloured, "change of luminance (%)").values()) < 5


def test_a_lobe_that_was_not_fitted_is_not_said_to_lie_elsewhere() -> None:
    d = ball((32, 32), 14.0, (15.5, 15.5))
    none = LobeFit.without_lobe("ggx", LobeFitOutcome.NO_SPECULAR, d.image.shape)
    bare = replace(d, brdf=none)
    assert framework._lobe_words(bare) == (
        " No lobe was fitted (undetermined: there is no specular light)."
    )
    assert framework._lobe_panel(bare, "3. GGX lobe", 1.0) == []
    wide = replace(d, brdf=replace(none, outcome=LobeFitOutcome.SMOOTH_LIGHT, predicted=d.image))
    assert "in smooth light, any roughness" in framework._lobe_words(wide)
    moved = replace(d, brdf=replace(none, outcome=LobeFitOutcome.DETERMINED, predicted=d.image))
    assert framework._lobe_words(moved).endswith("its highlight is elsewhere.")
    assert len(framework._lobe_panel(moved, "3. GGX lobe", 1.0)) == 1


def test_no_search_beats_the_exact_one(context: Context) -> None:
    reached = column(made("figure-3.4", context), "objective / optimum")
    assert reached.pop("exact") == 1.0
    assert len(reached) == 3
    assert all(0.9 < value <= 1 + 1e-12 for value in reached.values())
