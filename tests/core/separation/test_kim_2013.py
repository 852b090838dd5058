"""Kim et al. 2013: the dark channel, and the exact optima of both steps."""

import numpy as np
import pytest

from isc_core.progress import Monitor
from isc_core.separation.published import kim_2013
from isc_core.separation.published.kim_2013 import Kim2013Options
from tests.core.separation.scenes import gaussian_plate


def scene_of(image: np.ndarray, options: Kim2013Options) -> kim_2013.Scene:
    mask = np.ones(image.shape[:2], bool)
    return kim_2013.build_scene(image, mask, float(image.min(axis=2).mean()), options)


def test_the_dark_channel_comes_first() -> None:
    image = np.random.default_rng(0).random((14, 17, 3))
    options = Kim2013Options(patch=5, base=0.1, rounds=0)
    scene = scene_of(image, options)
    low = image.min(axis=2)
    for y, x in ((0, 0), (7, 9), (13, 4)):
        patch = low[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3]
        assert scene.dark[y, x] == max(patch.min() - 0.1 * low.mean(), 0)
    plain = Kim2013Options(patch=5, base=0.1, rounds=0, bright_saturation=0, fade=None)
    split = kim_2013.separate(image, np.ones((14, 17), bool), plain)
    assert split.specular[..., 0] == pytest.approx(scene.dark, abs=1e-6)


def test_the_colour_term_is_least_at_its_target() -> None:
    random = np.random.default_rng(1)
    image = random.random((4, 5, 3)) + 0.3
    albedos = random.random((20, 3))
    albedos /= np.linalg.norm(albedos, axis=1, keepdims=True)
    pull, target = kim_2013.colour_term(scene_of(image, Kim2013Options()), albedos)
    for colour, albedo, k, s_a, low in zip(
        image.reshape(-1, 3), albedos, pull.flat, target.flat, image.min(axis=2).flat, strict=True
    ):
        (_, best), *_ = np.linalg.lstsq(np.stack([albedo, np.ones(3)], axis=1), colour, rcond=None)
        assert s_a == pytest.approx(np.clip(best, 0, low), abs=1e-9)

        def misfit(s: float, colour: np.ndarray = colour, albedo: np.ndarray = albedo) -> float:
            rest = colour - s
            return float(rest @ rest - (rest @ albedo) ** 2)

        assert misfit(best + 0.1) - misfit(best) == pytest.approx(0.01 * k)


def test_sweeps_reach_the_least_energy_within_the_bounds() -> None:
    random = np.random.default_rng(2)
    image = random.random((6, 7, 3))
    options = Kim2013Options(sweeps=400)
    scene = scene_of(image, options)
    start, target, pull = random.random((6, 7)), random.random((6, 7)), random.random((6, 7)) + 0.05
    s = kim_2013.smooth_layer(start, target, pull, scene, options)
    weights = [
        options.smoothness / np.hypot(np.diff(start, axis=axis) / options.gradient, 1)
        for axis in (0, 1)
    ]
    slope = pull * (s - target)
    for axis, weight in enumerate(weights):
        pad = [(1, 1) if k == axis else (0, 0) for k in (0, 1)]
        slope -= np.diff(np.pad(weight * np.diff(s, axis=axis), pad), axis=axis)
    inner = (s > 0) & (s < scene.low)
    assert inner.sum() > 5 and (s == scene.low).sum() > 5
    assert np.abs(slope[inner]).max() < 1e-9
    assert slope[s == scene.low].max() <= 1e-9  # there only a larger s would be better
    assert slope[s == 0].min(initial=0) >= -1e-9


def test_grey_surface_takes_the_specular_light_of_its_surroundings() -> None:
    image = np.full((30, 30, 3), 0.4)
    options = Kim2013Options(sweeps=400)
    scene = scene_of(image, options)
    known = np.ones((30, 30))
    known[12:18, 12:18] = 0  # nothing pulls there
    s = kim_2013.smooth_layer(
        np.full((30, 30), 0.2), np.where(known, 0.2, 0.4), known, scene, options
    )
    assert np.allclose(s, 0.2, atol=1e-6)


def test_every_round_reports_both_steps() -> None:
    image, _, mask = gaussian_plate()
    heard: list[float] = []
    kim_2013.separate(
        image,
        mask,
        Kim2013Options(rounds=3),
        monitor=Monitor(lambda event: heard.append(event.fraction)),
    )
    assert len(heard) == 6
