"""The light's prior, told the light's mean colour: identities of Gaussians, and effect on SIRFS."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.decomposition.models import DecompositionTask, Settings, solve
from isc_core.decomposition.task import SolveOptions
from isc_core.photo import Photo, PhotoSource
from isc_core.shading.irradiance_basis import basis
from isc_core.sirfs.illumination import light_cost, unstack
from isc_core.sirfs.priors.light_colour import colour_on_a_ball, with_light_colour
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.settings import BALANCED_LIGHT, ISC_NATURAL

PRIOR = shipped_prior_set().priors("natural").light


def ball_normals(size: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    across = (np.arange(size) + 0.5) * 2 / size - 1
    down, right = np.meshgrid(across, across, indexing="ij")
    inside = down**2 + right**2 < 1
    down, right = down[inside], right[inside]
    return down, right, np.sqrt(1 - down**2 - right**2)


def test_the_colour_is_that_of_the_log_shading_averaged_over_a_ball() -> None:
    light = np.random.default_rng(0).normal(0, 0.3, (9, 3))
    mean = (basis(*ball_normals()).T @ light).mean(axis=0)
    expected = np.exp(mean - mean.mean())
    np.testing.assert_allclose(colour_on_a_ball(light), expected, rtol=2e-3)


def test_certainty_fixes_the_colour() -> None:
    colour = np.array([1.5, 1.0, 0.7])
    found = with_light_colour(PRIOR, colour, 1e-9)
    seen = colour_on_a_ball(unstack(found.mean, 3))
    np.testing.assert_allclose(seen, colour / np.prod(colour) ** (1 / 3), rtol=1e-3)


def test_ignorance_changes_nothing() -> None:
    found = with_light_colour(PRIOR, np.array([2.0, 1.0, 1.0]), 1e9)
    np.testing.assert_allclose(found.mean, PRIOR.mean, atol=1e-6)
    np.testing.assert_allclose(found.covariance, PRIOR.covariance, atol=1e-6)


def test_the_cost_grows_by_half_the_squared_distance_in_deviations() -> None:
    """What the condition adds to the light's term, but for a constant."""
    belief = replace(BALANCED_LIGHT, weight=0.7)
    told = with_light_colour(PRIOR, np.ones(3), belief.variance(ISC_NATURAL, 3))
    rng, added = np.random.default_rng(1), []
    for light in rng.normal(0, 0.2, (4, 9, 3)):
        before, after = (light_cost(light, one, ISC_NATURAL.light)[0] for one in (PRIOR, told))
        log_colour = np.log(colour_on_a_ball(light))
        distance = np.square(log_colour).sum() / belief.deviation**2
        added.append(after - before - 0.7 * 0.5 * distance)
    np.testing.assert_allclose(added, added[0], rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_a_cast_is_the_object_s_colour_rather_than_the_light_s() -> None:
    size = 64
    down, right = np.meshgrid(*2 * [(np.arange(size) - 31.5) / 28], indexing="ij")
    mask = down**2 + right**2 < 1
    up = np.sqrt(np.clip(1 - down**2 - right**2, 0, 1))
    shading = np.exp(0.9 * (0.5 * up - 0.4 * down - 0.3 * right) - 0.6)
    image = (shading[..., None] * np.array([0.8, 0.55, 0.06]) * mask[..., None]).astype(np.float32)
    photo = Photo(
        image, mask, 1 / 255, np.zeros_like(mask), PhotoSource("", (size, size), 8, "linear", "")
    )
    settings = Settings("sirfs", shape_prior="silhouette", light_prior="dataset")

    def ratio(weight: float) -> float:
        options = SolveOptions(light_colour_weight=replace(BALANCED_LIGHT, weight=weight))
        colour = colour_on_a_ball(
            solve(DecompositionTask(photo, photo, settings, options=options)).light
        )
        return float(colour.max() / colour.min())

    strong, weak = ratio(BALANCED_LIGHT.weight), ratio(1e-6)
    assert strong < 1.3
    assert np.log(strong) <= np.log(weak) + 0.01
