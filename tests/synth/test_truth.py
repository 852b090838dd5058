"""The ground truth of a scene: its identities, its units, and the light fitted to its shading."""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from isc_core.shading.spherical_harmonics import real_sh
from synth.capture.truth import GroundTruth, exposed, fit_light, render_truth
from synth.rendering import RenderOptions
from synth.scene import Scene
from synth.scene.camera import Camera
from synth.scene.lights import DirectionalLight, EnvironmentLight, panel_toward_origin
from synth.scene.materials import Material
from synth.shapes.gourd import gourd, gourd_albedo
from tests.properties.laws import threads

RADIOMETRIC = ("image", "diffuse", "specular", "residual", "shading")


def normals(count: int = 4000) -> np.ndarray:
    drawn = np.random.default_rng(3).normal(size=(count, 3))
    drawn[:, 2] = np.abs(drawn[:, 2])
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def scene() -> Scene:
    lights = (
        EnvironmentLight(np.full((16, 32, 3), 0.3, np.float32)),
        panel_toward_origin((-3.0, 4.0, 5.0), (1.5, 1.5), (40.0, 38.0, 35.0)),
    )
    return Scene(
        gourd(90, 121).turned(14),
        Material(gourd_albedo(256), "ggx", 0.15, 1.0),
        lights,
        Camera(48, 48, 21),
    )


@pytest.fixture(scope="module")
def truth(scene: Scene) -> GroundTruth:
    return render_truth(scene, RenderOptions(samples=16))


def test_the_layers_keep_their_identities(truth: GroundTruth) -> None:
    peak = truth.image.max()
    np.testing.assert_allclose(
        truth.image, truth.diffuse + truth.specular + truth.residual, atol=1e-6 * peak
    )
    np.testing.assert_allclose(truth.diffuse, truth.reflectance * truth.shading, atol=1e-6 * peak)
    np.testing.assert_allclose(np.linalg.norm(truth.normal, axis=-1), 1, atol=1e-5)


def test_maps_are_finite_and_empty_outside_the_mask(truth: GroundTruth) -> None:
    assert 0.2 < truth.mask.mean() < 0.8
    for name, values in truth.arrays().items():
        assert np.isfinite(values).all(), name
        if values.shape[:2] == truth.mask.shape and name not in ("normal", "mask"):
            assert not values[~truth.mask].any(), name
    assert (truth.normal[~truth.mask] == (0, 0, 1)).all()
    assert (truth.normal[truth.mask][:, 2] > 0).mean() > 0.99


def test_normals_are_those_of_the_height_in_pixels(truth: GroundTruth) -> None:
    rows, columns = np.gradient(truth.height)
    slopes = np.dstack([-columns, rows, np.ones_like(rows)])
    slopes /= np.linalg.norm(slopes, axis=-1, keepdims=True)
    inner = (
        truth.mask
        & np.roll(truth.mask, 2, 0)
        & np.roll(truth.mask, -2, 0)
        & np.roll(truth.mask, 2, 1)
        & np.roll(truth.mask, -2, 1)
    )
    angle = np.degrees(np.arccos(np.clip((slopes * truth.normal).sum(-1), -1, 1)))[inner]
    assert np.median(angle) < 4


def test_brighter_lights_brighten_the_radiance_alone(scene: Scene, truth: GroundTruth) -> None:
    brighter_scene, brighter = exposed(scene, truth, level=0.7)
    assert np.quantile(brighter.diffuse[brighter.mask], 0.995) == pytest.approx(0.7, rel=1e-5)
    gain = brighter.shading.sum() / truth.shading.sum()
    for name in RADIOMETRIC:
        np.testing.assert_allclose(
            getattr(brighter, name), gain * getattr(truth, name), rtol=1e-4, atol=1e-7
        )
    for name in ("reflectance", "normal", "height", "strength", "gloss"):
        np.testing.assert_array_equal(getattr(brighter, name), getattr(truth, name))
    again = render_truth(brighter_scene, RenderOptions(samples=16))
    np.testing.assert_allclose(again.image, brighter.image, rtol=2e-3, atol=1e-4)
    np.testing.assert_allclose(again.illumination, brighter.illumination, atol=5e-3)


def test_the_same_seed_gives_the_same_maps(scene: Scene, truth: GroundTruth) -> None:
    again = render_truth(scene, RenderOptions(samples=16))
    for name, values in truth.arrays().items():
        np.testing.assert_array_equal(values, getattr(again, name), err_msg=name)


def test_the_environment_holds_the_light_of_the_panel(truth: GroundTruth) -> None:
    row, column = np.unravel_index(
        np.argmax(truth.environment.sum(-1)), truth.environment.shape[:2]
    )
    rows = len(truth.environment)
    polar, turn = (row + 0.5) * np.pi / rows, (column + 0.5) * np.pi / rows
    toward = np.array([np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)])
    assert toward @ (np.array([-3.0, 4.0, 5.0]) / np.sqrt(50)) > 0.95


@pytest.mark.parametrize("seed", range(3))
def test_a_light_of_our_form_is_found_exactly(seed: int) -> None:
    light = (
        np.random.default_rng(seed).normal(size=(9, 3))
        * np.array([1, *[0.6] * 3, *[0.25] * 5])[:, None]
    )
    shading = np.exp(real_sh(normals()) @ light)
    found, misfit = fit_light(normals(), shading)
    assert misfit < 2e-3
    np.testing.assert_allclose(np.exp(real_sh(normals()) @ found), shading, rtol=0.02)


def test_the_fitted_light_is_the_same_on_any_number_of_threads() -> None:
    towards = np.random.default_rng(0).normal(size=(6000, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    shading = np.exp(real_sh(towards) @ np.random.default_rng(1).normal(0, 0.4, (9, 3)))
    found = []
    for count in (1, 3):
        with threads(count):
            found.append(fit_light(towards, shading)[0])
    assert np.array_equal(*found)


def test_the_fitted_light_follows_a_gain_and_survives_black_shadows() -> None:
    sun = np.maximum(
        normals() @ DirectionalLight(np.array([0.6, 0.0, 0.8]), np.ones(3)).direction, 0
    )
    shading = np.stack([sun, 0.5 * sun, np.zeros_like(sun)], 1)
    found, misfit = fit_light(normals(), shading)
    assert np.isfinite(found).all()
    assert misfit < 0.15
    np.testing.assert_allclose(
        found[0, 1] - found[0, 0], np.log(0.5) * np.sqrt(4 * np.pi), atol=1e-6
    )
    assert np.exp(real_sh(normals()) @ found[:, 2]).max() < 1e-6
    brightest = normals()[np.argmax(real_sh(normals()) @ found[:, 0])]
    assert brightest @ (0.6, 0, 0.8) > 0.9
