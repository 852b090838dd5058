"""Photos under coloured light: what a model makes of them under white light, with the colour put
back.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from isc_core.decomposition.light_colour import solve_under_estimated_light, solve_under_given_light
from isc_core.decomposition.models import DecompositionTask, SceneEstimate, Settings
from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.shape import desaturated
from isc_core.errors import InputError
from isc_core.illuminant.illuminant import estimate_illuminant
from isc_core.photo import Photo, PhotoSource
from isc_core.result_files.diagnostics_text import (
    STRONG_COLOUR,
    WHITE_ASSUMED,
    light_colour_advice,
)
from isc_core.scene.decomposition import Separation
from isc_core.scene.diagnostics import Diagnostics, IlluminantOutcome, StopReason
from isc_core.scene.lobe_fit import Interval, LobeFit, LobeFitOutcome, LobeLight
from isc_core.separation import separate
from isc_core.shading.spherical_harmonics import light_from_reference
from isc_core.sirfs.recover import SOLVE_SIZE
from tests.core.illuminant.test_illuminant import ALBEDOS, LIGHT, ball
from tests.core.small_solves import small_solves

MADE = Diagnostics(reason=StopReason.STEP)


def photo_of(albedos: np.ndarray, light: np.ndarray, gloss: float = 0.5, size: int = 120) -> Photo:
    image, mask = ball(albedos, light, gloss, size)
    source = PhotoSource("0" * 64, (size, size), 12, "linear", "file")
    return Photo(image.astype(np.float32), mask, 1 / 4095, np.zeros(mask.shape, bool), source)


def task_of(photo: Photo, light_colour: str = "estimate") -> DecompositionTask:
    return DecompositionTask(photo, photo, Settings(model="mdr", light_colour=light_colour))


def seen_by(task: DecompositionTask) -> SceneEstimate:
    """A model that separates and says that everything is evenly lit, with a white lobe."""
    split = separate("isc", task.maps.image, task.maps.mask)
    lamp = LobeLight(
        np.array([0.0, 0, 1]), 2.0, np.ones(3), Interval(0.5 * np.ones(3), 2 * np.ones(3))
    )
    brdf = LobeFit(
        "ggx",
        LobeFitOutcome.DETERMINED,
        0.2,
        Interval(0.1, 0.3),
        (lamp,),
        None,
        None,
        1.0,
        split.specular,
    )
    return SceneEstimate(split, np.zeros(task.maps.mask.shape), np.zeros((9, 3)), MADE, brdf)


def test_what_is_seen_is_white_and_what_comes_back_has_the_light_s_colour() -> None:
    photo, seen = photo_of(ALBEDOS, LIGHT), []

    def solver(task: DecompositionTask) -> SceneEstimate:
        seen.append(task)
        return seen_by(task)

    answer = solve_under_estimated_light(task_of(photo), solver)
    colour = estimate_illuminant(photo.image, photo.mask).colour
    assert seen[0].one_scale and np.allclose(seen[0].working.image, photo.image / colour, atol=1e-6)
    split, white = answer.split, seen_by(seen[0]).split
    np.testing.assert_allclose(split.specular, white.specular * colour, atol=1e-6)
    assert (
        np.abs(split.diffuse + split.specular + split.residual - photo.image)[photo.mask].max()
        < 1e-5 * photo.image.max()
    )
    shading = np.exp(light_from_reference(answer.light)[0] * np.sqrt(1 / (4 * np.pi)))
    np.testing.assert_allclose(shading, colour)
    assert answer.brdf is not None and np.allclose(answer.brdf.lights[0].strength_light, colour)
    found = answer.diagnostics.light_colour
    assert found is not None
    assert found.used == "estimate" and found.determined
    assert np.allclose(found.estimate, colour, atol=1e-4)
    assert answer.diagnostics.reason == MADE.reason


@pytest.mark.parametrize(("albedos", "asked"), [(ALBEDOS, "balanced"), (ALBEDOS[:1], "estimate")])
def test_white_is_taken_where_that_is_asked_for_or_nothing_is_known(
    albedos: np.ndarray, asked: str
) -> None:
    photo = photo_of(albedos, LIGHT)
    answer, usual = (
        solve_under_estimated_light(task_of(photo, asked), seen_by),
        seen_by(task_of(photo)),
    )
    np.testing.assert_array_equal(answer.split.diffuse, usual.split.diffuse)
    np.testing.assert_array_equal(answer.split.confidence, usual.split.confidence)
    found = answer.diagnostics.light_colour
    assert found is not None and found.used == "balanced"
    assert ("--light-colour estimate" in light_colour_advice(found)) == (asked == "balanced")
    assert (light_colour_advice(found) == WHITE_ASSUMED) == (asked == "estimate")


def test_light_of_a_colour_that_no_lamp_has_lowers_the_confidence_and_says_so() -> None:
    photo = photo_of(ALBEDOS, np.array([1.3, 1.0, 0.7]))
    answer, usual = solve_under_estimated_light(task_of(photo), seen_by), seen_by(task_of(photo))
    assert estimate_illuminant(photo.image, photo.mask).outcome.too_strong
    np.testing.assert_allclose(answer.split.confidence, 0.5 * usual.split.confidence)
    found = answer.diagnostics.light_colour
    assert found is not None and found.used == "balanced"
    assert light_colour_advice(found) == STRONG_COLOUR
    assert found.outcome == IlluminantOutcome.STRONG_HIGHLIGHT_COLOUR


def test_layers_that_are_known_already_are_taken_along() -> None:
    photo = photo_of(ALBEDOS, LIGHT)
    split = separate("none", photo.image, photo.mask)

    def given(task: DecompositionTask) -> SceneEstimate:
        assert task.split is not None
        return replace(seen_by(task), split=task.split)

    found: Separation = solve_under_estimated_light(
        replace(task_of(photo), split=split), given
    ).split
    np.testing.assert_allclose(found.diffuse, split.diffuse, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["joint", "mbp"])
def test_the_identities_hold_in_the_end(model: str) -> None:
    d = decompose(
        photo_of(ALBEDOS, LIGHT, size=64),
        Settings(model=model, light_colour="estimate", confidence_weights=model == "joint"),
    )
    assert d.identity_errors().broken() == ()
    light = d.provenance.diagnostics.light_colour
    assert light is not None and light.used == "estimate"
    assert d.provenance.settings["light_colour"] == "estimate"


def test_options_that_mean_nothing_to_a_model_are_refused() -> None:
    for settings in (
        Settings(model="naive", light_colour="estimate"),
        Settings(model="mbp", confidence_weights=True),
        Settings(model="sirfs", separator="shen_2013"),
        Settings(model="retinex", separator="network"),
    ):
        with pytest.raises(InputError, match="does not apply to"):
            settings.check()
    for separator in ("isc", "none"):  # the default, and what such a model does
        Settings(model="retinex", separator=separator).check()
    for colour in ("red", "1,2", "1,0,1", "-1,-1,-1", "1,1,200", "nan,1,1", "inf,1,1"):
        with pytest.raises(InputError, match="unknown light colour"):
            Settings(light_colour=colour).check()


def test_the_former_name_of_balanced_light_is_understood() -> None:
    assert Settings(light_colour="white") == Settings()


def test_a_given_colour_is_divided_out_and_put_back() -> None:
    photo, seen = photo_of(ALBEDOS, LIGHT), []

    def solver(task: DecompositionTask) -> SceneEstimate:
        seen.append(task)
        return seen_by(task)

    answer = solve_under_given_light(task_of(photo, "2,1,.5"), solver)
    colour = np.array([12, 6, 3]) / 7
    np.testing.assert_allclose(seen[0].working.image, photo.image / colour, atol=1e-6)
    np.testing.assert_allclose(
        light_from_reference(answer.light)[0] * np.sqrt(1 / (4 * np.pi)), np.log(colour)
    )


@pytest.mark.slow
@pytest.mark.parametrize("model", ["sirfs", "mdr", "mbp", "joint"])
def test_a_cast_given_as_the_light_s_colour_changes_nothing_else(model: str) -> None:
    """The photo times a colour, under light of that colour, has the same shape and albedo.

    The colour's channels are powers of two and their mean is 1: division loses no digit, and the
    solver starts from the same bits. One other digit may end in another of its many minima.
    """
    photo, colour = photo_of(ALBEDOS, np.ones(3), size=48), np.array([2, 0.5, 0.5])
    plain = decompose(photo, Settings(model=model))
    tinted = decompose(
        replace(photo, image=(photo.image * colour).astype(np.float32)),
        Settings(model=model, light_colour="2,.5,.5"),
    )
    np.testing.assert_allclose(tinted.reflectance, plain.reflectance, atol=1e-5)
    np.testing.assert_allclose(tinted.normal, plain.normal, atol=1e-5)
    assert tinted.expected_error is not None and plain.expected_error is not None
    np.testing.assert_allclose(
        tinted.expected_error.reflectance, plain.expected_error.reflectance, atol=1e-4
    )


def test_tempered_colours_keep_grey_and_brightness_and_bound_the_ratio_of_channels() -> None:
    image = np.random.default_rng(0).uniform(0, 1, (5, 6, 3)).astype(np.float32)
    image[0, 0], image[0, 1] = 0.4, (0.5, 0.2, 0)
    found = desaturated(image)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found[0, 0], 0.4, rtol=1e-6)
    np.testing.assert_allclose(found.max(axis=2), image.max(axis=2), rtol=1e-6)
    assert (found.min(axis=2) >= 0.09 * found.max(axis=2)).all()
    np.testing.assert_allclose(desaturated(2 * image), 2 * found, rtol=1e-6)


@pytest.mark.slow
def test_noise_in_a_dark_channel_is_no_relief(monkeypatch: pytest.MonkeyPatch) -> None:
    """A saturated ball whose blue is noise: smoother than with every channel as it is.

    At the full size: the solve at a quarter of it averages the noise.
    """
    photo = photo_of(ALBEDOS[:1] * 0 + np.array([0.5, 0.55, 0.02]), np.ones(3), gloss=0, size=64)
    rng = np.random.default_rng(0)
    noise = ndimage.gaussian_filter(rng.normal(0, 0.03, photo.mask.shape), 1.5)
    image = photo.image.copy()
    image[..., 2] = np.where(photo.mask, np.maximum(image[..., 2] + noise, 0.002), 0)
    noisy = replace(photo, image=image)

    def roughness() -> float:
        with small_solves(SOLVE_SIZE, steps=None):
            normal = decompose(noisy, Settings("sirfs")).normal
        off = normal - ndimage.gaussian_filter(normal, (2, 2, 0))
        inner = ndimage.binary_erosion(photo.mask, iterations=6)
        return float(np.square(off[inner]).sum(axis=1).mean() ** 0.5)

    found = roughness()
    monkeypatch.setattr(Settings, "desaturates", False)
    assert found < 0.8 * roughness()
