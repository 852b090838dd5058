"""The separator with the highlight network, and when it does not change a photo."""

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.networks.highlight_network import predict_highlights
from isc_core.separation import separate
from isc_core.separation.network import expected_ratio
from isc_core.separation.support.light_tint import limit_tint


def ball(
    side: int = 160, albedo: tuple[float, float, float] = (0.5, 0.5, 0.5), gloss: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A ball under one lamp: image, diffuse image, mask."""
    y, x = np.mgrid[1 : -1 : side * 1j, -1 : 1 : side * 1j] / 0.9
    mask = x**2 + y**2 < 1
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], -1)
    lamp = np.array([0.4, 0.5, 0.77]) / np.linalg.norm([0.4, 0.5, 0.77])
    half = (lamp + [0, 0, 1]) / np.linalg.norm(lamp + [0, 0, 1])
    diffuse = (0.1 + np.maximum(normal @ lamp, 0))[..., None] * np.array(albedo) * mask[..., None]
    specular = gloss * np.maximum(normal @ half, 0)[..., None] ** 60 * np.ones(3) * mask[..., None]
    return (diffuse + specular).astype(np.float32), diffuse.astype(np.float32), mask


def test_a_highlight_on_grey_is_found_where_colour_shows_nothing() -> None:
    image, diffuse, mask = ball()
    split = separate("network", image, mask)
    left = np.square(split.diffuse - diffuse)[mask].mean()
    assert left < 0.5 * np.square(image - diffuse)[mask].mean()
    assert np.abs(separate("isc", image, mask).diffuse - image)[mask].max() < 1e-3
    np.testing.assert_allclose(
        (split.diffuse + split.specular + split.residual)[mask], image[mask], atol=1e-6
    )


@pytest.mark.parametrize("side", [60, 160, 420])
@pytest.mark.parametrize("albedo", [(0.6, 0.5, 0.3), (0.5, 0.5, 0.5), (0.8, 0.1, 0.1)])
def test_matt_balls_keep_their_light(side: int, albedo: tuple[float, float, float]) -> None:
    image, _, mask = ball(side, albedo, gloss=0)
    np.testing.assert_array_equal(separate("network", image, mask).diffuse, image)


def test_confidence_sorts_pixels_by_their_error() -> None:
    image, diffuse, mask = ball()
    split = separate("network", image, mask)
    error = np.abs(split.diffuse - diffuse).mean(-1)[mask]
    order = np.argsort(split.confidence[mask])
    fifth = len(order) // 5
    assert error[order[:fifth]].sum() > 2 * error[order[-fifth:]].sum()


def test_a_margin_of_the_log_odds_removes_less() -> None:
    image, _, mask = ball()
    found = [predict_highlights(image, mask, margin) for margin in (0, 1, 3)]
    ratios = [expected_ratio(image, one) for one in found]
    assert ratios[0].sum() > ratios[1].sum() > ratios[2].sum() > 0
    left = image * np.exp(-ratios[0])
    likely = found[0].share > 0.2
    wanted = np.where(likely[..., None], image - found[0].specular[..., None], image)
    np.testing.assert_allclose(left[mask], wanted[mask], atol=2e-3 * image.max())


@pytest.mark.parametrize("tint", [1.0, 1.5])
def test_removed_light_is_not_more_coloured_than_light(tint: float) -> None:
    rng = np.random.default_rng(4)
    seen = rng.uniform(0.01, 1, (40, 50, 3)).astype(np.float32)
    diffuse = limit_tint(seen, seen * rng.uniform(0.05, 1, seen.shape).astype(np.float32), tint)
    light = seen - diffuse
    assert (diffuse >= 0).all() and light.min() > -1e-6
    assert (light.max(-1) <= tint * light.min(-1) + 1e-6).all()


def test_white_light_stays_off_and_green_light_on_green_goes_back() -> None:
    albedo = np.array([0.3, 0.5, 0.05], np.float32) * np.ones((4, 5, 1), np.float32)
    np.testing.assert_allclose(limit_tint(albedo + 0.2, albedo, 1.5), albedo, atol=1e-6)
    np.testing.assert_allclose(limit_tint(albedo, albedo, 1.5), albedo)
    green = np.array([0.1, 0.18, 0.01], np.float32)
    kept = limit_tint(albedo + green, albedo, 1.0)
    level = (albedo + green - kept)[0, 0]
    costs = [np.square((level[0] + d - green) / albedo[0, 0]).sum() for d in (-0.001, 0, 0.001)]
    # the white light whose diffuse layer differs least in its logarithm
    assert np.ptp(level) < 1e-6 and costs[1] == min(costs)


@pytest.mark.parametrize(
    "change",
    [{"log_odds_margin": -1.0}, {"stands_out": -0.1}, {"tint": 0.9}, {"tint": float("nan")}],
)
def test_options_out_of_range_are_refused(change: dict[str, object]) -> None:
    image, _, mask = ball(40)
    with pytest.raises(InputError, match=next(iter(change))):
        separate("network", image, mask, changes=change)
