"""Lobes are found again in images that were made of them, and what cannot be known is said to be
unknown.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from isc_core.errors import Cancelled, InputError
from isc_core.lobe_fitting import GivenLight, PixelData, RecoveredScene, fit_lobe
from isc_core.lobe_fitting.environment_response import (
    interpolated_response,
    respond_to,
    split_environment,
)
from isc_core.lobe_fitting.lamps import Lamps, Problem, evaluate, step_parameters
from isc_core.lobe_fitting.observed import observe
from isc_core.lobe_fitting.pixels import choose_pixels
from isc_core.lobe_fitting.recovered import blurred_normals
from isc_core.lobe_fitting.response import respond
from isc_core.progress import Monitor
from isc_core.scene.light_estimate import PLACES, LightEstimate
from isc_core.scene.lobe_fit import LobeFitOptions, LobeFitOutcome
from isc_core.shading.brdf.blinn_phong import BlinnPhong
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.model import Lobe
from isc_core.shading.brdf.roughness import alpha_from_exponent
from isc_core.shading.environment_map import directions, solid_angles
from isc_core.shading.radiance import DistantLights, directional, environment, radiance

VIEW = np.array([0.0, 0, 1])
KEY = np.array([-0.48, 0.6, 0.64])
COLOUR = np.array([3.0, 2.5, 2.0])


def ball(size: int = 96) -> tuple[np.ndarray, np.ndarray]:
    """Normals (size, size, 3) and mask of an ellipsoid that nearly fills the picture."""
    y, x = np.meshgrid(
        np.linspace(1, -1, size) / 0.9, np.linspace(-1, 1, size) / 0.9, indexing="ij"
    )
    square = x * x + y * y
    mask = square < 0.97
    normal = np.dstack([x, 0.8 * y, np.sqrt(np.where(mask, 1 - square, 1))])
    normal[~mask] = VIEW
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True), mask


def seen(
    lobe: Lobe, lights: DistantLights, size: int = 96
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Specular image, normals and mask."""
    normal, mask = ball(size)
    return np.where(mask[..., None], radiance(lobe, normal, VIEW, lights), 0), normal, mask


def angle(a: np.ndarray | None, b: np.ndarray) -> float:
    """Degrees between two unit vectors."""
    assert a is not None
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


@pytest.mark.parametrize("model", ["ggx", "blinn_phong"])
def test_the_response_is_that_of_the_brdf_and_its_gradient_that_of_differences(model: str) -> None:
    rng = np.random.default_rng(0)
    normal = rng.normal(size=(60, 3)) + (0, 0, 1.5)
    normal[:, 2] = np.abs(normal[:, 2])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    for alpha in (0.05, 0.2, 0.6):
        lobe = Ggx(alpha, 0.04) if model == "ggx" else BlinnPhong(1.0, 2 / alpha**2 - 2)
        answer = respond(model, normal, KEY, alpha)  # type: ignore[arg-type]
        np.testing.assert_allclose(
            answer.value,
            radiance(lobe, normal, VIEW, directional(KEY, 1.0))[:, 0],
            rtol=1e-9,
            atol=1e-12,
        )
        step = 1e-6
        up, down = (respond(model, normal, KEY, alpha * np.exp(s)).value for s in (step, -step))  # type: ignore[arg-type]
        scale = answer.value.max()
        np.testing.assert_allclose(
            answer.by_log_alpha, (up - down) / (2 * step), rtol=1e-5, atol=1e-6 * scale
        )
        for across in (np.array([0.8, 0, 0.6]), np.cross(KEY, [0.8, 0, 0.6])):
            turned = [KEY + s * across for s in (step, -step)]
            up, down = (respond(model, normal, t / np.linalg.norm(t), alpha).value for t in turned)  # type: ignore[arg-type]
            np.testing.assert_allclose(
                answer.by_light @ across,
                (up - down) / (2 * step),
                rtol=1e-4,
                atol=1e-5 * scale / alpha,
            )
        for across in np.cross(normal, [0.8, 0, 0.6]), np.cross(normal, [0, 1, 0]):
            turned = [normal + s * across for s in (step, -step)]
            turned = [t / np.linalg.norm(t, axis=1, keepdims=True) for t in turned]
            up, down = (respond(model, t, KEY, alpha).value for t in turned)  # type: ignore[arg-type]
            np.testing.assert_allclose(
                (answer.by_normal * across).sum(axis=1),
                (up - down) / (2 * step),
                rtol=1e-4,
                atol=1e-5 * scale / alpha,
            )


@pytest.mark.parametrize("alpha", [0.05, 0.1, 0.25, 0.45])
def test_a_lobe_under_one_light_is_found_exactly(alpha: float) -> None:
    fit = fit_lobe(*seen(Ggx(alpha), directional(KEY, COLOUR)))
    assert fit.determined and len(fit.lights) == 1
    assert fit.alpha == pytest.approx(alpha, rel=1e-3)
    np.testing.assert_allclose(fit.strength_light, COLOUR, rtol=1e-3)
    assert angle(fit.direction, KEY) < 0.05
    assert fit.explained > 0.9999
    assert fit.blender_roughness == pytest.approx(np.sqrt(alpha), rel=1e-3)


@pytest.mark.parametrize("exponent", [20.0, 300.0])
def test_a_blinn_phong_lobe_is_found_exactly(exponent: float) -> None:
    scene = seen(BlinnPhong(0.3, exponent), directional(KEY, COLOUR))
    fit = fit_lobe(*scene, options=LobeFitOptions(model="blinn_phong"))
    assert fit.exponent == pytest.approx(exponent, rel=3e-3)
    assert fit.alpha == pytest.approx(float(alpha_from_exponent(exponent)), rel=2e-3)
    np.testing.assert_allclose(fit.strength_light, 0.3 * COLOUR, rtol=3e-3)
    assert angle(fit.direction, KEY) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3])
def test_several_lights_are_counted(count: int) -> None:
    towards = np.array([KEY, [0.6, 0.0, 0.8], [-0.1, -0.7, np.sqrt(0.5)]])[:count]
    power = np.array([[3.0], [2.0], [1.5]])[:count] * [1, 0.9, 0.8]
    fit = fit_lobe(*seen(Ggx(0.12), DistantLights(towards, power)))
    assert len(fit.lights) == count
    assert fit.alpha == pytest.approx(0.12, rel=0.01)
    for light, direction, strength in zip(fit.lights, towards, power, strict=True):
        assert angle(light.direction, direction) < 0.3
        np.testing.assert_allclose(light.strength_light, strength, rtol=0.02)


def test_a_known_direction_is_kept() -> None:
    fit = fit_lobe(*seen(Ggx(0.2), directional(KEY, COLOUR)), light=GivenLight(direction=KEY))
    np.testing.assert_allclose(fit.direction, KEY, rtol=1e-14)  # it is normalised again
    assert fit.lights[0].cone == 0
    assert fit.alpha == pytest.approx(0.2, rel=1e-3)


@pytest.mark.slow
def test_the_intervals_grow_with_the_noise_and_hold_the_truth() -> None:
    specular, normal, mask = seen(Ggx(0.2), directional(KEY, COLOUR))
    inside, widths = [], []
    specular += 0.5 * specular.max()  # so that noise takes nothing below zero
    for noise in (0.02, 0.1):
        for seed in range(10):
            drawn = (
                np.random.default_rng(seed).normal(size=specular.shape)
                * noise
                * 2
                / 3
                * specular.max()
            )
            fit = fit_lobe(
                np.maximum(specular + drawn, 0),
                normal,
                mask,
                options=LobeFitOptions(most_lights=1, most_pixels=1500),
            )
            assert fit.alpha_interval is not None
            inside.append(fit.alpha_interval.low < 0.2 < fit.alpha_interval.high)
            widths.append(np.log(fit.alpha_interval.high / fit.alpha_interval.low))
    assert np.mean(widths[10:]) > 1.5 * np.mean(widths[:10]) > 0
    assert 0.45 <= np.mean(inside) <= 0.9


@pytest.mark.slow
def test_wrong_normals_widen_the_intervals_when_said_so() -> None:
    scene = seen(Ggx(0.2), directional(KEY, COLOUR))
    sure, unsure = fit_lobe(*scene), fit_lobe(*scene, options=LobeFitOptions(normal_error=15))
    assert sure.lights[0].cone < 0.5 and 10 < unsure.lights[0].cone < 40
    assert unsure.alpha_interval is not None
    assert unsure.alpha_interval.low < 0.18 and unsure.alpha_interval.high > 0.22


@pytest.mark.slow
def test_pixels_without_confidence_and_clipped_ones_do_not_spoil_the_fit() -> None:
    specular, normal, mask = seen(Ggx(0.15), directional(KEY, COLOUR))
    clip = 0.3 * specular.max()
    clipped = (specular > clip).any(-1)
    fit = fit_lobe(np.minimum(specular, clip), normal, mask, pixels=PixelData(clipped=clipped))
    assert fit.alpha == pytest.approx(0.15, rel=0.02)
    spoilt, confidence = specular.copy(), np.ones(mask.shape)
    spoilt[60:80, 50:70], confidence[60:80, 50:70] = specular.max(), 0
    assert fit_lobe(
        spoilt, normal, mask, pixels=PixelData(confidence=confidence)
    ).alpha == pytest.approx(0.15, rel=0.01)


def test_without_specular_light_nothing_is_invented() -> None:
    normal, mask = ball()
    for fit in (
        fit_lobe(np.zeros(normal.shape), normal, mask),
        fit_lobe(np.ones(normal.shape), normal, np.zeros_like(mask)),
    ):
        assert fit.outcome == LobeFitOutcome.NO_SPECULAR and not fit.determined
        assert fit.alpha is None and fit.lights == () and not fit.predicted.any()


@pytest.mark.slow
def test_a_smooth_light_leaves_alpha_undetermined() -> None:
    normal, mask = ball()
    towards, solid = directions(16), solid_angles(16)
    smooth = np.exp(0.8 * towards[..., 1] + 0.5 * towards[..., 0])[..., None] * np.ones(3)
    lights = environment(towards.reshape(-1, 3), solid.ravel(), smooth.reshape(-1, 3))
    specular = np.zeros(normal.shape)
    specular[mask] = radiance(Ggx(0.3), normal[mask], VIEW, lights)
    fit = fit_lobe(specular, normal, mask)
    assert not fit.determined and fit.alpha is None


def test_a_highlight_narrower_than_a_pixel_gives_an_upper_bound() -> None:
    specular, normal, mask = seen(Ggx(0.01), directional(KEY, COLOUR), 48)
    fit = fit_lobe(specular, normal, mask)
    assert fit.outcome == LobeFitOutcome.NARROW and not fit.determined
    assert fit.alpha is not None and fit.alpha >= 0.01


def test_the_response_to_an_environment_is_the_sum_over_its_pixels() -> None:
    rng = np.random.default_rng(1)
    env_map = 0.2 + rng.random((16, 32, 3)).cumsum(1) / 16
    env_map[4, 17] += 30
    normal = np.array([[0.0, 0, 1], [0.3, 0.4, np.sqrt(0.75)], [-0.6, 0.0, 0.8]])
    lights = environment(
        directions(16).reshape(-1, 3), solid_angles(16).ravel(), env_map.reshape(-1, 3)
    )
    for model, lobe in (("ggx", Ggx(0.4)), ("blinn_phong", BlinnPhong(1.0, 2 / 0.4**2 - 2))):
        found = respond_to(split_environment(env_map), model, normal, 0.4)  # type: ignore[arg-type]
        np.testing.assert_allclose(found, radiance(lobe, normal, VIEW, lights), rtol=0.05)


@pytest.mark.parametrize(("size", "error"), [(48, 1e-9), (200, 0.06)])
def test_a_sharp_lobe_is_predicted_as_sharp(size: int, error: float) -> None:
    lamp = np.zeros((64, 128, 3))
    lamp[20, 70] = 1 / solid_angles(64)[20, 70]
    env_map, (normal, mask) = split_environment(lamp), ball(size)
    exact = respond_to(env_map, "ggx", normal[mask], 0.05)
    found = interpolated_response(env_map, "ggx", 0.05, normal[mask])
    assert np.linalg.norm(found - exact) < error * np.linalg.norm(exact)


@pytest.mark.slow
def test_under_a_known_environment_strength_and_alpha_are_found() -> None:
    normal, mask = ball()
    towards, solid = directions(24), solid_angles(24)
    env_map = np.full((24, 48, 3), 0.1)
    env_map[5:8, 26:30] += (20, 18, 15)
    lights = environment(towards.reshape(-1, 3), solid.ravel(), env_map.reshape(-1, 3))
    specular = np.zeros(normal.shape)
    specular[mask] = 0.7 * radiance(Ggx(0.2), normal[mask], VIEW, lights)
    fit = fit_lobe(specular, normal, mask, light=GivenLight(environment=env_map))
    assert fit.determined
    assert fit.alpha == pytest.approx(0.2, rel=0.05)
    np.testing.assert_allclose(fit.strength, 0.7, rtol=0.05)
    assert fit.explained > 0.99


@pytest.mark.slow
def test_under_an_even_environment_alpha_is_undetermined() -> None:
    normal, mask = ball(48)
    mask &= (
        normal[..., 2] > 0.6
    )  # toward grazing angles the gloss of rough surfaces does look different
    env_map = np.ones((16, 32, 3))
    specular = np.zeros(normal.shape)
    specular[mask] = respond_to(split_environment(env_map), "ggx", normal[mask], 0.3)
    specular *= np.random.default_rng(0).uniform(0.7, 1.3, mask.shape)[..., None]
    fit = fit_lobe(specular, normal, mask, light=GivenLight(environment=env_map))
    assert fit.outcome == LobeFitOutcome.SMOOTH_LIGHT and fit.alpha is None


@pytest.mark.slow
def test_the_same_input_gives_the_same_answer_and_it_is_ready_for_json() -> None:
    scene = seen(Ggx(0.2), directional(KEY, COLOUR))
    first, second = fit_lobe(*scene), fit_lobe(*scene)
    text = json.dumps(first.to_json(), allow_nan=False)
    assert text == json.dumps(second.to_json(), allow_nan=False)
    np.testing.assert_array_equal(first.predicted, second.predicted)
    assert json.loads(text)["alpha"] == first.alpha


@pytest.mark.slow
def test_brighter_light_changes_the_product_alone() -> None:
    specular, normal, mask = seen(Ggx(0.2), directional(KEY, COLOUR))
    dim, bright = fit_lobe(specular, normal, mask), fit_lobe(1000 * specular, normal, mask)
    assert dim.strength_light is not None
    assert bright.alpha == pytest.approx(dim.alpha, rel=1e-5)
    np.testing.assert_allclose(bright.strength_light, 1000 * dim.strength_light, rtol=1e-5)


def test_what_does_not_fit_together_is_refused() -> None:
    specular, normal, mask = seen(Ggx(0.2), directional(KEY, COLOUR), 24)
    broken = specular.copy()
    broken[12, 12] = np.nan
    env_map = np.ones((8, 16, 3))
    for arguments, keywords in (
        ((specular[:-1], normal, mask), {}),
        ((specular, 2 * normal, mask), {}),
        ((broken, normal, mask), {}),
        ((-specular, normal, mask), {}),
        ((specular, normal, mask.astype(float)), {}),
        ((specular, normal, mask), {"pixels": PixelData(confidence=np.full(mask.shape, 2.0))}),
        ((specular, normal, mask), {"light": GivenLight(direction=np.array([1.0, 1, 1]))}),
        ((specular, normal, mask), {"light": GivenLight(KEY, env_map)}),
        ((specular, normal, mask), {"light": GivenLight(environment=env_map[:, :-1])}),
        ((specular, normal, mask), {"light": GivenLight(environment=-env_map)}),
    ):
        with pytest.raises(InputError):
            fit_lobe(*arguments, **keywords)  # type: ignore[arg-type]
    for options in ({"model": "mirror"}, {"most_lights": 4}, {"normal_error": 90}, {"floor": 0}):
        with pytest.raises(InputError):
            replace(LobeFitOptions(), **options)  # type: ignore[arg-type]


def test_it_can_be_cancelled() -> None:
    with pytest.raises(Cancelled):
        fit_lobe(
            *seen(Ggx(0.2), directional(KEY, COLOUR), 24), monitor=Monitor(cancelled=lambda: True)
        )


def whole_chain(
    alpha: float, strength: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Specular image, cut off at a level as separators do, wavy normals, mask, and the shading of a
    white diffuse surface.
    """
    specular, normal, mask = seen(Ggx(alpha), directional(KEY, np.pi * strength))
    shading = np.where(
        mask[..., None],
        radiance(BlinnPhong(0, 1), normal, VIEW, directional(KEY))
        + np.maximum(normal @ KEY, 0)[..., None],
        0,
    )
    row, column = np.indices(mask.shape)
    wavy = normal + 0.2 * np.dstack([np.sin(row / 3), np.cos(column / 4), 0 * row])
    wavy[..., 2] = np.maximum(wavy[..., 2], 0.05)
    cut = np.maximum(specular - 0.2 * specular.max(), 0)
    return cut, wavy / np.linalg.norm(wavy, axis=-1, keepdims=True), mask, shading


@pytest.mark.parametrize("alpha", [0.1, 0.2, 0.4])
def test_what_was_recovered_from_one_photo_gives_alpha_by_the_brightness_of_the_highlight(
    alpha: float,
) -> None:
    specular, normal, mask, shading = whole_chain(alpha)
    fit = fit_lobe(specular, normal, mask, recovered=RecoveredScene(shading))
    assert fit.determined and fit.alpha is not None
    assert abs(np.log(fit.alpha / alpha)) < np.log(1.5)
    assert fit.strength_light is not None
    assert abs(fit.strength_light.mean() / np.pi - 1) < 0.4
    assert angle(fit.direction, KEY) < 25


def test_what_the_outline_says_helps_where_the_normals_are_wrong() -> None:
    specular, normal, mask, shading = whole_chain(0.2)
    flat = normal * (0.4, 0.4, 1)
    flat /= np.linalg.norm(flat, axis=-1, keepdims=True)
    true = seen(Ggx(0.2), directional(KEY, np.pi))[1]
    without, helped = (
        fit_lobe(
            specular,
            flat,
            mask,
            recovered=RecoveredScene(shading, silhouette_normals=outline),
        )
        for outline in (None, true)
    )
    assert angle(helped.direction, KEY) < angle(without.direction, KEY) - 5
    with pytest.raises(InputError, match="silhouette"):
        fit_lobe(
            specular,
            flat,
            mask,
            recovered=RecoveredScene(shading, silhouette_normals=true[1:]),
        )


def seen_at_first_sight(toward: np.ndarray, none: float = 0.1) -> LightEstimate:
    """One light, with some uncertainty."""
    places = np.exp(30 * (PLACES @ toward))
    return LightEstimate(none, 0.9 - none, 0.1, places / places.sum())


def test_where_the_lamp_seems_to_stand_is_believed_and_the_picture_stays() -> None:
    specular, normal, mask, shading = whole_chain(0.2)
    toward = np.array([0.6, -0.1, np.sqrt(1 - 0.37)])
    light_estimate = seen_at_first_sight(toward)
    without, told = (
        fit_lobe(
            specular,
            normal,
            mask,
            recovered=RecoveredScene(shading, light_estimate=seen),
        )
        for seen in (None, light_estimate)
    )
    assert angle(told.direction, toward) < 1 and told.lights[0].cone == pytest.approx(
        light_estimate.cone
    )
    assert told.alpha == without.alpha and told.explained == without.explained
    np.testing.assert_array_equal(told.predicted, without.predicted)
    known = fit_lobe(
        specular,
        normal,
        mask,
        recovered=RecoveredScene(shading, light_estimate=light_estimate),
        light=GivenLight(direction=KEY),
    )
    assert angle(known.direction, KEY) < 1e-4 and known.lights[0].cone == 0


def test_a_light_that_looks_smooth_leaves_the_roughness_open() -> None:
    specular, normal, mask, shading = whole_chain(0.2)
    fit = fit_lobe(
        specular,
        normal,
        mask,
        recovered=RecoveredScene(shading, light_estimate=seen_at_first_sight(KEY, 0.7)),
    )
    assert not fit.determined and fit.alpha is None and fit.outcome == LobeFitOutcome.SMOOTH_LIGHT


def test_the_recovered_fit_does_not_depend_on_the_exposure() -> None:
    specular, normal, mask, shading = whole_chain(0.2)
    dim = fit_lobe(specular, normal, mask, recovered=RecoveredScene(shading))
    bright = fit_lobe(50 * specular, normal, mask, recovered=RecoveredScene(50 * shading))
    assert bright.alpha == pytest.approx(dim.alpha, rel=1e-9)
    np.testing.assert_allclose(
        bright.strength_light, 50 * np.asarray(dim.strength_light), rtol=1e-9
    )


@pytest.mark.parametrize("shown", [0.5, 0.2, 0.1])
@pytest.mark.parametrize("alpha", [0.1, 0.2])
def test_a_highlight_brighter_than_the_photo_could_show_gives_an_upper_bound(
    alpha: float, shown: float
) -> None:
    specular, normal, mask, shading = whole_chain(alpha)
    white = shown * specular.max()
    cut, clipped = np.minimum(specular, white), (specular >= white).any(-1)
    fit = fit_lobe(
        cut, normal, mask, recovered=RecoveredScene(shading), pixels=PixelData(clipped=clipped)
    )
    assert (
        (fit.determined, fit.outcome) == (False, LobeFitOutcome.CLIPPED)
        and fit.alpha is not None
        and fit.alpha_interval is not None
    )
    assert fit.alpha_interval.low < alpha < fit.alpha_interval.high == fit.alpha
    assert angle(fit.direction, KEY) < 25
    one_hot = np.zeros_like(mask)
    one_hot[np.unravel_index(specular.sum(-1).argmax(), mask.shape)] = True
    assert fit_lobe(
        specular, normal, mask, recovered=RecoveredScene(shading), pixels=PixelData(clipped=one_hot)
    ).determined


def test_where_no_lobe_explains_the_light_none_and_no_lamps_are_made_up() -> None:
    _, normal, mask = seen(Ggx(0.2), directional(KEY, np.pi))
    noise = np.where(
        mask[..., None],
        np.random.default_rng(3).uniform(size=(*mask.shape, 1)) ** 40 * np.ones(3),
        0,
    )
    fit = fit_lobe(noise, normal, mask)
    assert (fit.outcome, fit.determined, fit.alpha, fit.lights) == (
        LobeFitOutcome.UNEXPLAINED,
        False,
        None,
        (),
    )
    assert not fit.predicted.any() and fit.explained < 0.25


def test_what_a_separator_leaves_on_a_matt_object_is_no_gloss() -> None:
    _, normal, mask, shading = whole_chain(0.2)
    crumbs = np.zeros_like(shading)
    crumbs[40:44, 50:53] = 0.05
    fit = fit_lobe(crumbs, normal, mask, recovered=RecoveredScene(shading))
    assert fit.outcome == LobeFitOutcome.NO_SPECULAR and fit.alpha is None and fit.lights == ()


@pytest.mark.parametrize("size", [40, 300])
def test_normals_are_blurred_by_blocks_as_by_pixels(size: int) -> None:
    normal, mask = ball(size)
    mask &= np.arange(size) < 0.7 * size
    normal += 0.2 * np.random.default_rng(1).normal(size=normal.shape)
    width = 0.3 * np.sqrt(mask.sum())
    wanted = np.dstack(
        [
            gaussian_filter(np.where(mask, normal[..., k], 0), width, mode="constant")
            for k in range(3)
        ]
    )
    wanted /= np.linalg.norm(wanted, axis=-1, keepdims=True)
    found = blurred_normals(normal, mask)
    assert np.degrees(np.arccos(np.clip((found * wanted).sum(-1)[mask], -1, 1))).max() < 0.5
    np.testing.assert_array_equal(found[~mask], np.broadcast_to(VIEW, found[~mask].shape))
    padded = blurred_normals(
        np.pad(normal, [(3, 5), (7, 0), (0, 0)]), np.pad(mask, [(3, 5), (7, 0)])
    )
    np.testing.assert_array_equal(padded[3:-5, 7:], found)


def test_recovered_images_need_their_shading() -> None:
    specular, normal, mask, shading = whole_chain(0.2)
    for given in (shading[:-1], -shading):
        with pytest.raises(InputError):
            fit_lobe(specular, normal, mask, recovered=RecoveredScene(given))


def test_a_separators_level_is_found() -> None:
    specular, normal, mask = seen(Ggx(0.15), directional(KEY, COLOUR))
    cut = np.maximum(specular - 0.15 * specular.max(), 0)
    known, unknown = (
        fit_lobe(cut, normal, mask, options=LobeFitOptions(thresholded=t)) for t in (True, False)
    )
    assert known.alpha is not None and known.alpha == pytest.approx(0.15, rel=0.1)
    off = abs(np.log(known.alpha / 0.15))
    assert unknown.alpha is None or abs(np.log(unknown.alpha / 0.15)) > off


@pytest.mark.slow
def test_a_near_light_is_told_from_a_far_one() -> None:
    _, mask = ball()
    row, column = np.indices(mask.shape)
    radius = 48 * 0.9
    depth = np.sqrt(
        np.maximum(0, 1 - ((column - 47.5) / radius) ** 2 - ((47.5 - row) / radius) ** 2)
    )
    round_normal = np.where(
        mask[..., None], np.dstack([(column - 47.5) / radius, (47.5 - row) / radius, depth]), VIEW
    )
    round_normal /= np.linalg.norm(round_normal, axis=-1, keepdims=True)
    place = np.dstack([(column - 47.5) / radius, (47.5 - row) / radius, depth - 0.5])
    toward = 3 * KEY - place
    distance = np.linalg.norm(toward, axis=-1)
    arriving = toward / distance[..., None]
    value = (
        Ggx(0.15).value(round_normal, VIEW, arriving)
        * np.maximum((round_normal * arriving).sum(-1), 0)
        * 9
        / distance**2
    )
    specular = np.where(mask, value, 0)[..., None] * np.ones(3)
    far = fit_lobe(specular, round_normal, mask)
    near = fit_lobe(specular, round_normal, mask, pixels=PixelData(height=depth * radius))
    assert far.alpha is not None and near.alpha is not None
    assert abs(near.alpha / 0.15 - 1) < 0.05 < abs(far.alpha / 0.15 - 1)


@pytest.mark.parametrize("thresholded", [False, True])
def test_the_jacobian_of_the_whole_model_is_that_of_differences(thresholded: bool) -> None:
    specular, normal, mask = seen(Ggx(0.2), directional(KEY, COLOUR), 32)
    height = 8 * normal[..., 2]
    picture = observe(np.maximum(specular - 0.1, 0), normal, mask, PixelData(height=height))
    problem = Problem(choose_pixels(picture, (0.02, 0.1), 400), "ggx", thresholded, nearness=True)
    base = np.array([0.3]) if thresholded else np.array([0.1, -0.05, 0.2, 0.03])
    towards = np.array([KEY, [0.6, 0.0, 0.8]])
    lamps = Lamps(towards, np.array([0.2, 0.3]), np.log([2.0, 1.0]), base, float(np.log(0.25)))
    here, step = evaluate(problem, lamps), 1e-6
    for column_number in range(here.jacobian.shape[1]):
        change = np.zeros(here.jacobian.shape[1])
        change[column_number] = step
        there = evaluate(problem, step_parameters(lamps, change, problem))
        active = (here.weight > 0) & (there.weight > 0)
        slope = (there.residual - here.residual)[active] / step
        np.testing.assert_allclose(
            slope,
            here.jacobian[active, column_number],
            rtol=2e-3,
            atol=1e-3 * np.abs(slope).max() + 1e-5,
        )


@pytest.mark.slow
def test_a_rendered_highlight_is_found() -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    from synth.capture.truth import render_truth
    from synth.rendering import RenderOptions
    from synth.scene import Scene
    from synth.scene.camera import Camera
    from synth.scene.lights import DirectionalLight
    from synth.scene.materials import Material
    from synth.shapes import make_shape

    material = Material(np.full((2, 2, 3), 0.4), "ggx", 0.18, 0.8)
    scene = Scene(
        make_shape("blobby", np.random.default_rng(2)),
        material,
        (DirectionalLight(KEY, COLOUR),),
        Camera(64, 64, 28),
    )
    truth = render_truth(scene, RenderOptions(samples=8))
    fit = fit_lobe(truth.specular, truth.normal, truth.mask, pixels=PixelData(height=truth.height))
    assert fit.determined
    assert fit.alpha == pytest.approx(0.18, rel=0.05)
    np.testing.assert_allclose(fit.strength_light, 0.8 * COLOUR, rtol=0.05)
    assert angle(fit.direction, KEY) < 2
