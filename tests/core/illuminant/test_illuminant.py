"""The light's colour from highlights, on balls whose light is known."""

import numpy as np
import pytest

from benchmarks.separation.illuminant import markdown, measure, relit
from isc_core.datasets.highlight_set import SeparationTruth
from isc_core.errors import InputError
from isc_core.illuminant.illuminant import (
    Illuminant,
    IlluminantOptions,
    estimate_illuminant,
    tinted,
    whitened,
)
from tests.angles import degrees_between

LIGHT = np.array([1.15, 1.0, 0.85])
ALBEDOS = np.array([[0.6, 0.15, 0.1], [0.1, 0.5, 0.15], [0.15, 0.2, 0.6], [0.5, 0.45, 0.1]])


def ball(
    albedos: np.ndarray, light: np.ndarray, gloss: float, size: int = 120
) -> tuple[np.ndarray, np.ndarray]:
    """A ball with one sector for each albedo, which all meet under the highlight."""
    y, x = (np.mgrid[:size, :size] - (size - 1) / 2) / (0.46 * size)
    mask = x**2 + y**2 < 1
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    sector = ((np.arctan2(y, x) / (2 * np.pi) + 0.5) * len(albedos)).astype(int) % len(albedos)
    shading = 0.3 + 0.7 * z
    image = light * (albedos[sector] * shading[..., None] + gloss * (z**25)[..., None])
    return np.where(mask[..., None], image, 0), mask


def angle(colour: np.ndarray, other: np.ndarray) -> float:
    return float(degrees_between(colour, other))


@pytest.mark.parametrize("light", [np.ones(3), LIGHT, LIGHT[::-1], np.array([0.9, 1.2, 0.9])])
def test_several_paints_give_the_light(light):
    found = estimate_illuminant(*ball(ALBEDOS, light, 0.5))
    assert found.determined and found.confidence > 0.5
    assert angle(found.colour, light) < 2
    assert found.colour.mean() == pytest.approx(1, abs=1e-12) and found.colour.min() > 0


def test_one_paint_is_not_enough_and_stays_nearer_to_white():
    found = estimate_illuminant(*ball(ALBEDOS[:1], LIGHT, 0.5))
    assert not found.determined
    assert angle(found.colour, LIGHT) < angle(np.ones(3), LIGHT)
    # The one plane of albedo and light must hold what is said.
    normal = np.cross(ALBEDOS[0] * LIGHT, LIGHT)
    assert abs(normal @ found.colour) / np.linalg.norm(normal) < 0.02


@pytest.mark.parametrize("gloss", [0.0, 0.5])
def test_white_without_information(gloss):
    grey = np.full((1, 3), 0.4)
    albedos = ALBEDOS if gloss == 0 else grey
    found = estimate_illuminant(*ball(albedos, np.ones(3), gloss))
    assert not found.determined
    assert angle(found.colour, np.ones(3)) < 0.5


def test_exposure_turning_and_surroundings_do_not_matter():
    image, mask = ball(ALBEDOS, LIGHT, 0.5)
    found = estimate_illuminant(image, mask)
    np.testing.assert_allclose(
        estimate_illuminant(image * 37, mask).colour, found.colour, atol=1e-9
    )
    np.testing.assert_allclose(
        estimate_illuminant(np.rot90(image), np.rot90(mask)).colour, found.colour, atol=2e-3
    )
    around = np.where(mask[..., None], image, 9.0)
    np.testing.assert_array_equal(estimate_illuminant(around, mask).colour, found.colour)


def test_clipped_pixels_are_ignored():
    image, mask = ball(ALBEDOS, LIGHT, 0.5)
    cut = np.minimum(image, 0.7)
    found = estimate_illuminant(cut, mask, (image >= 0.7).any(axis=2))
    assert angle(found.colour, LIGHT) < angle(np.ones(3), LIGHT)
    assert not estimate_illuminant(image, mask, mask).determined


def test_a_narrower_prior_gives_a_smaller_tint():
    image, mask = ball(ALBEDOS, LIGHT, 0.5)
    near, far = (
        estimate_illuminant(image, mask, options=IlluminantOptions(prior_deviation=usual))
        for usual in (0.005, 0.2)
    )
    assert near.confidence < far.confidence
    assert angle(near.colour, np.ones(3)) < angle(far.colour, np.ones(3))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_whitened_and_back(dtype):
    image = np.random.default_rng(0).random((9, 8, 3)).astype(dtype)
    white = whitened(image, LIGHT)
    assert white.dtype == dtype
    np.testing.assert_allclose(tinted(white, LIGHT), image, rtol=4 * np.finfo(dtype).eps)
    np.testing.assert_array_equal(whitened(image, np.ones(3)), image)
    layers = white * dtype(0.25), white * dtype(0.75)
    np.testing.assert_allclose(
        sum(tinted(layer, LIGHT) for layer in layers), image, rtol=8 * np.finfo(dtype).eps
    )


def test_codes_become_floats():
    codes = np.random.default_rng(0).integers(1, 256, (9, 8, 3)).astype(np.uint8)
    np.testing.assert_allclose(whitened(codes, LIGHT), codes / LIGHT, rtol=1e-6)
    np.testing.assert_allclose(tinted(codes, LIGHT), codes * LIGHT, rtol=1e-6)


def test_the_benchmark_relights_exactly_and_has_the_ground_truth():
    white = np.ones(3)
    (image, mask), (diffuse, _) = ball(ALBEDOS, white, 0.5), ball(ALBEDOS, white, 0.0)
    layers = [layer.astype(np.float32) for layer in (image, diffuse, image - diffuse)]
    truth = SeparationTruth("ball", layers[0], mask, layers[1], layers[2], np.zeros_like(mask))
    scene = relit(truth, LIGHT)
    np.testing.assert_allclose(scene.image, ball(ALBEDOS, LIGHT, 0.5)[0], atol=1e-6)
    np.testing.assert_allclose(scene.diffuse + scene.specular, scene.image, atol=1e-6)
    found = measure("balls", scene, LIGHT, False)
    assert found.determined and found.angle < 2 < found.of_white
    as_white, sure, always, true_light = found.ratios
    assert true_light < as_white and sure == always < as_white
    assert markdown([found]).count("\n") == 3


def test_what_does_not_fit_is_refused():
    image, mask = ball(ALBEDOS, LIGHT, 0.5)
    for arrays in (
        (image[..., 0], mask),
        (image, mask[1:]),
        (image, np.zeros_like(mask)),
        (image, mask.astype(np.uint8)),
        (image, mask, mask[1:]),
        (image, mask, np.zeros(mask.shape)),
    ):
        with pytest.raises(InputError, match="the light's colour needs"):
            estimate_illuminant(*arrays)
    for options in (
        IlluminantOptions(prior_deviation=0),
        IlluminantOptions(prior_deviation=float("nan")),
        IlluminantOptions(common_deviation=-1),
        IlluminantOptions(min_confidence=2),
    ):
        with pytest.raises(InputError, match="prior_deviation must be"):
            estimate_illuminant(image, mask, options=options)
    for colour in (np.array([1.0, 0, 1]), np.ones(4), np.array([np.nan, 1, 1])):
        with pytest.raises(InputError, match="three numbers above 0"):
            whitened(image, colour)
    assert isinstance(estimate_illuminant(image, mask), Illuminant)
