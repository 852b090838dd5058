"""Print and highlights on balls of known paint: what colour and form together take off."""

import numpy as np
import pytest

from isc_core.decomposition.joint import supported_layers
from isc_core.networks.scene_network import predict_scene
from isc_core.separation import separate
from isc_core.separation.support.highlight_evidence import highlight_evidence, supported

RED, WHITE = np.array([0.5, 0.06, 0.05]), np.array([0.8, 0.78, 0.76])
SIDE = 96


def ball(stripe: float = 0.0, gloss: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Photo, diffuse image and mask of a red ball with a white stripe of a width, and a highlight
    of a strength.
    """
    line = np.linspace(-1.1, 1.1, SIDE)
    x, y = np.meshgrid(line, -line)
    mask = x**2 + y**2 < 1
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    shading = 0.15 + 0.85 * np.clip(-0.35 * x + 0.45 * y + 0.82 * z, 0, 1)
    paint = np.where((np.abs(x - 0.2) < stripe / 2)[..., None], WHITE, RED)
    diffuse = np.where(mask[..., None], paint * shading[..., None], 0)
    spot = gloss * np.exp(-((x + 0.2) ** 2 + (y - 0.25) ** 2) / 0.012)
    photo = diffuse + np.where(mask, spot, 0)[..., None]
    return photo.astype(np.float32), diffuse.astype(np.float32), mask


def form(photo: np.ndarray, diffuse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The truth's log ratio, and a scale that is sure of it."""
    ratio = np.log(np.maximum(photo, 1e-4) / np.maximum(diffuse, 1e-4))
    return ratio, np.full(photo.shape[:2], 0.1)


def test_a_highlight_that_colour_and_form_show_is_kept() -> None:
    photo, diffuse, mask = ball(gloss=0.4)
    kept = supported(photo, diffuse, mask, *form(photo, diffuse))
    removed = (photo - diffuse).sum(axis=2)
    assert removed[kept].sum() > 0.95 * removed.sum()


def test_white_paint_of_which_form_is_not_sure_is_given_back() -> None:
    photo, _, mask = ball(stripe=0.2)
    without, _, _ = ball()
    removed = np.minimum(photo, without)
    ratio, scale = form(photo, removed)
    assert (photo > removed).any()
    assert not supported(photo, removed, mask, 0.1 * ratio, scale).any()


@pytest.mark.parametrize("stripe", [0.05, 0.12, 0.3])
def test_a_sharp_white_stripe_on_a_matt_ball_stays_bit_for_bit(stripe: float) -> None:
    photo, _, mask = ball(stripe=stripe)
    split, added = supported_layers(photo, separate("isc", photo, mask), mask)
    assert added is None
    np.testing.assert_array_equal(split.diffuse, photo)
    assert not split.specular.any() and not split.residual.any()


def test_a_true_highlight_on_a_ball_is_still_separated() -> None:
    photo, diffuse, mask = ball(gloss=0.4)
    split, added = supported_layers(photo, separate("isc", photo, mask), mask)
    found = split.diffuse if added is None else added.diffuse
    nothing = np.square((photo - diffuse)[mask]).sum()
    assert np.square((found - diffuse)[mask]).sum() < 0.5 * nothing


def test_more_is_asked_for_less_is_kept() -> None:
    photo, _, mask = ball(stripe=0.2, gloss=0.4)
    start = separate("isc", photo, mask).diffuse
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
    assert not supported(photo, photo, mask, *form(photo, photo)).any()
