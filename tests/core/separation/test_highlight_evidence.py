"""Print and highlights on balls of known paint: what colour and form together take off."""

from typing import Any

import numpy as np
import pytest

import isc_core
from isc_core.decomposition.joint import supported_layers
from isc_core.decomposition.settings import Settings
from isc_core.errors import InputError
from isc_core.networks.scene_network import predict_scene
from isc_core.photo.highlight_marks import HighlightMarks
from isc_core.separation import COLOUR_ALONE, HIGHLIGHT_ODDS, separate
from isc_core.separation.support.highlight_evidence import (
    classify_highlights,
    highlight_evidence,
)
from tests.core.separation.scenes import BALL_SIDE, ball


def supported(*evidence: Any, **options: Any) -> np.ndarray:
    return classify_highlights(*evidence, **options).kept


def form(photo: np.ndarray, diffuse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The truth's log ratio, and a scale that is sure of it."""
    ratio = np.log(np.maximum(photo, 1e-4) / np.maximum(diffuse, 1e-4))
    return ratio, np.full(photo.shape[:2], 0.1)


def test_a_highlight_that_colour_and_form_show_is_kept() -> None:
    photo, diffuse, mask = ball(gloss=0.4)
    kept = supported(photo, diffuse, mask, *form(photo, diffuse), HIGHLIGHT_ODDS)
    removed = (photo - diffuse).sum(axis=2)
    assert removed[kept].sum() > 0.95 * removed.sum()


def test_white_paint_of_which_form_is_not_sure_is_given_back() -> None:
    photo, _, mask = ball(stripe=0.2)
    without, _, _ = ball()
    removed = np.minimum(photo, without)
    ratio, scale = form(photo, removed)
    assert (photo > removed).any()
    assert not supported(photo, removed, mask, 0.1 * ratio, scale, HIGHLIGHT_ODDS).any()


def test_likely_highlights_that_stay_are_counted() -> None:
    photo, diffuse, mask = ball(gloss=0.4)
    evidence = photo, diffuse, mask, *form(photo, diffuse)
    share = float((photo - diffuse)[mask].sum() / photo[mask].sum())
    strict = classify_highlights(*evidence, odds=1e9)
    assert not strict.kept.any() and strict.doubtful == pytest.approx(share, rel=0.05)
    assert classify_highlights(*evidence, odds=HIGHLIGHT_ODDS).doubtful == 0
    rows, columns = np.nonzero((photo - diffuse).sum(axis=2) > 0.5)
    place = (int(columns[0]), int(rows[0]))
    for marks in (HighlightMarks((place,)), HighlightMarks((), (place,))):
        assert classify_highlights(*evidence, odds=1e9, marks=marks).doubtful == 0


@pytest.mark.parametrize("stripe", [0.05, 0.12, 0.3])
def test_a_sharp_white_stripe_on_a_matt_ball_stays_bit_for_bit(stripe: float) -> None:
    photo, _, mask = ball(stripe=stripe)
    layers = supported_layers(photo, separate("isc", photo, mask, changes=COLOUR_ALONE), mask)
    split = layers.split
    assert layers.residual is None
    np.testing.assert_array_equal(split.diffuse, photo)
    assert not split.specular.any() and not split.residual.any()


def test_a_true_highlight_on_a_ball_is_still_separated() -> None:
    photo, diffuse, mask = ball(gloss=0.4)
    found = supported_layers(
        photo, separate("isc", photo, mask, changes=COLOUR_ALONE), mask
    ).diffuse
    nothing = np.square((photo - diffuse)[mask]).sum()
    assert np.square((found - diffuse)[mask]).sum() < 0.5 * nothing


def test_more_is_asked_for_less_is_kept() -> None:
    photo, _, mask = ball(stripe=0.2, gloss=0.4)
    start = separate("isc", photo, mask, changes=COLOUR_ALONE).diffuse
    seen = predict_scene(photo, mask)
    answers = [
        supported(photo, start, mask, seen.log_ratio, seen.ratio_scale, odds)
        for odds in (1e-3, 0.3, 1, 3, 1e3)
    ]
    for more, less in zip(answers, answers[1:], strict=False):
        assert (less <= more).all()
    assert answers[0].any() and not answers[-1].any()


def test_mirror_images_have_mirrored_answers() -> None:
    photo, diffuse, mask = ball(stripe=0.2, gloss=0.4)
    ratio, scale = form(photo, diffuse)
    there = highlight_evidence(photo, diffuse, mask, ratio, scale)
    back = highlight_evidence(
        photo[:, ::-1], diffuse[:, ::-1], mask[:, ::-1], ratio[:, ::-1], scale
    )
    np.testing.assert_array_equal(back.labels[:, ::-1] > 0, there.labels > 0)
    np.testing.assert_allclose(np.sort(back.values, axis=0), np.sort(there.values, axis=0))


def test_where_nothing_was_removed_nothing_is_kept() -> None:
    photo, _, mask = ball(stripe=0.2)
    assert not supported(photo, photo, mask, *form(photo, photo), HIGHLIGHT_ODDS).any()


def test_a_mark_decides_where_the_odds_do_not() -> None:
    photo, diffuse, mask = ball(gloss=0.4)
    ratio, scale = form(photo, diffuse)
    evidence = photo, diffuse, mask, 0.05 * ratio, scale
    place = (BALL_SIDE * 0.41, BALL_SIDE * 0.386)  # of the highlight
    assert not supported(*evidence, odds=100).any()
    kept = supported(*evidence, odds=100, marks=HighlightMarks((place,)))
    removed = (photo - diffuse).sum(axis=2)
    assert removed[kept].sum() > 0.95 * removed.sum()
    assert not supported(*evidence, odds=1e-9, marks=HighlightMarks((), (place,))).any()
    far = (BALL_SIDE * 0.7, BALL_SIDE * 0.7)
    assert not supported(*evidence, odds=100, marks=HighlightMarks((far,))).any()


@pytest.mark.parametrize("size", [64, 0])
def test_what_is_marked_as_paint_stays_at_any_size_of_the_maps(size: int) -> None:
    photo, _, mask = (
        np.kron(one, np.ones((4, 4) + (1,) * (one.ndim - 2))) for one in ball(gloss=0.4)
    )
    given, settings = (photo.astype(np.float32), mask > 0), Settings(max_size=size, detail=0)
    marks = HighlightMarks((), ((4 * BALL_SIDE * 0.41, 4 * BALL_SIDE * 0.386),))
    without, found = (
        isc_core.decompose(*given, settings=settings, marks=one) for one in (None, marks)
    )
    assert without.specular.sum() > 10 and not found.specular.any()
    assert found.provenance.input["marked_paint"] == [[157, 148]]
    assert "marked_paint" not in without.provenance.input


def test_smaller_odds_take_more_off() -> None:
    photo, _, mask = ball(stripe=0.12, gloss=0.2)
    light = [
        isc_core.decompose(
            photo, mask, settings=Settings(detail=0, highlight_odds=odds)
        ).specular.sum()
        for odds in (1e9, 3.0, 0.0)
    ]
    assert light[0] == 0 <= light[1] <= light[2] and light[2] > 0


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (Settings(highlight_odds=-1), "odds of 0 or more"),
        (Settings(highlight_odds=float("nan")), "odds of 0 or more"),
        (Settings(model="sirfs", highlight_odds=1), "does not apply to sirfs"),
    ],
)
def test_wrong_odds_are_refused(settings: Settings, words: str) -> None:
    with pytest.raises(InputError, match=words):
        settings.check()


@pytest.mark.parametrize(
    ("marks", "settings", "words"),
    [
        (HighlightMarks(((1.0, 1.0),)), Settings(), "the mark 1,1 lies outside of the object"),
        (HighlightMarks(((900.0, 1.0),)), Settings(), "lies outside of the object"),
        (HighlightMarks(((40.0, 40.0),)), Settings(model="mdr"), "do not apply to mdr"),
    ],
)
def test_marks_that_cannot_be_used_are_refused(
    marks: HighlightMarks, settings: Settings, words: str
) -> None:
    photo, _, mask = ball(gloss=0.4)
    with pytest.raises(InputError, match=words):
        isc_core.decompose(photo, mask, settings=settings, marks=marks)


def slope(photo: np.ndarray, diffuse: np.ndarray, mask: np.ndarray, clipped: np.ndarray) -> float:
    """What the chroma says of the largest region."""
    found = highlight_evidence(photo, diffuse, mask, *form(photo, diffuse), clipped)
    sizes = [np.count_nonzero(found.labels == number) for number in found.numbers]
    return float(found.values[int(np.argmax(sizes)), 2])


def test_chroma_stays_under_light_and_falls_under_white_paint() -> None:
    nowhere = np.zeros((BALL_SIDE, BALL_SIDE), bool)
    photo, diffuse, mask = ball(gloss=0.4)
    assert slope(photo, diffuse, mask, nowhere) > 0
    photo, _, mask = ball(stripe=0.2)
    assert slope(photo, np.minimum(photo, ball()[0]), mask, nowhere) < -0.2


def test_a_clipped_core_does_not_make_a_highlight_look_like_paint() -> None:
    photo, diffuse, mask = ball(gloss=1.5)
    clipped = (photo >= 1).any(axis=2) & mask
    photo = np.minimum(photo, 1)
    assert (photo[clipped] >= 1).all(axis=1).any()
    assert slope(photo, diffuse, mask, np.zeros_like(mask)) < 0
    assert slope(photo, diffuse, mask, clipped) > 0


@pytest.mark.parametrize(("exposure", "hidden"), [(1.0, False), (2.1, True)])
def test_shading_beside_a_clipped_region_does_not_speak_for_a_highlight(
    exposure: float, hidden: bool
) -> None:
    matt, _, mask = ball()
    level = np.where(mask, matt.max(axis=2) / matt.max(), 0)
    photo = np.minimum(exposure * matt, 1)
    clipped = (photo >= 1).any(axis=2) & mask
    bright = np.clip((level - 0.95) / 0.05, 0, 1)[..., None]
    assert clipped.any() == hidden
    rise = slope(photo, (1 - 0.5 * bright) * photo, mask, clipped)
    assert rise == 0 if hidden else rise > 0.4


def test_the_exposure_does_not_matter() -> None:
    photo, diffuse, mask = ball(stripe=0.2, gloss=0.4)
    seen = form(photo, diffuse)
    there, darker = (
        highlight_evidence(k * photo, k * diffuse, mask, *seen).values for k in (1, 2.0**-20)
    )
    np.testing.assert_allclose(there, darker, rtol=1e-4)


def test_paint_is_continued_under_a_clipped_highlight_and_beside_it() -> None:
    photo, diffuse, mask = ball(gloss=1.5)
    clipped = (photo >= 1).any(axis=2) & mask
    photo = np.minimum(photo, 1)
    start = separate("isc", photo, mask, clipped, changes=COLOUR_ALONE)
    found = supported_layers(photo, start, mask, clipped=clipped).diffuse
    bright = (photo - diffuse).sum(axis=2) > 0.6
    assert (bright & ~clipped).any() and (bright & clipped).any()
    np.testing.assert_allclose(found[bright], diffuse[bright], atol=0.12)
