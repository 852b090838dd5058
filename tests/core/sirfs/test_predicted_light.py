"""A light's prior that is told how the light looks: what it must become, and what must stay."""

import numpy as np
import pytest

from isc_core.shading.spherical_harmonics import light_from_reference, light_to_reference, real_sh
from isc_core.sirfs.priors.predicted_light import FRONT_NORMALS, LIGHT_TERMS, predicted_light_prior
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.priors.priors import LightPrior

SEEN = np.array([0.5, 0.3, -0.2, 0.1, 0.05, -0.1, 0.02, 0.08])


def prior(channels: int) -> LightPrior:
    return shipped_prior_set().priors("natural", channels).light


def look_of(stacked: np.ndarray) -> np.ndarray:
    """How a light of stacked coefficients looks: the channels' mean."""
    return LIGHT_TERMS @ light_from_reference(stacked.reshape(-1, 9).mean(axis=0))


def test_the_look_is_made_of_orthonormal_functions_without_a_constant() -> None:
    values = real_sh(FRONT_NORMALS)
    values = values - values.mean(axis=0)
    light = np.random.default_rng(0).normal(size=9)
    # A shading's mean square is the sum of its parts' squares, whatever its constant.
    assert np.square(values @ light).mean() == pytest.approx(np.square(LIGHT_TERMS @ light).sum())
    assert np.abs(LIGHT_TERMS[:, 0]).max() == 0


def test_the_look_of_a_mirrored_light_is_the_mirrored_look() -> None:
    odd = np.array([1, 1, -1, -1, 1, 1, -1, 1])
    light = np.random.default_rng(1).normal(size=9)
    np.testing.assert_allclose(
        LIGHT_TERMS @ (light * np.concatenate([[1], odd])), odd * (LIGHT_TERMS @ light), atol=1e-12
    )


@pytest.mark.parametrize("channels", [1, 3])
def test_who_is_sure_is_believed_and_who_is_not_is_not(channels: int) -> None:
    usual = prior(channels)
    sure, unsure = (
        predicted_light_prior(usual, SEEN, np.full(8, deviation)) for deviation in (1e-5, 1e4)
    )
    np.testing.assert_allclose(look_of(sure.mean), SEEN, atol=1e-4)
    np.testing.assert_allclose(unsure.mean, usual.mean, atol=1e-5)
    np.testing.assert_allclose(unsure.covariance, usual.covariance, atol=1e-6)


def test_two_sights_are_one_of_both() -> None:
    rng = np.random.default_rng(2)
    first, second, spread = rng.normal(0, 0.3, 8), rng.normal(0, 0.3, 8), rng.uniform(0.1, 0.4, 8)
    twice = predicted_light_prior(predicted_light_prior(prior(3), first, spread), second, spread)
    once = predicted_light_prior(prior(3), (first + second) / 2, spread / np.sqrt(2))
    np.testing.assert_allclose(twice.mean, once.mean, atol=1e-9)
    np.testing.assert_allclose(twice.covariance, once.covariance, atol=1e-12)


def test_colour_and_brightness_are_not_looked_at() -> None:
    usual = prior(3)
    told = predicted_light_prior(usual, SEEN, np.full(8, 0.05))
    values = np.linalg.eigvalsh(told.covariance)
    assert (
        values.min() > 0 and (np.linalg.eigvalsh(usual.covariance - told.covariance) > -1e-12).all()
    )
    # Which way the channels differ, the prior holds to be independent of what they have in common
    # only roughly.
    before, after = (light.mean.reshape(3, 9) for light in (usual, told))
    assert (
        np.abs((after - after.mean(0)) - (before - before.mean(0))).max()
        < 0.3 * np.abs(after - before).max()
    )


def test_a_light_of_the_prior_is_left_alone() -> None:
    usual = prior(3)
    told = predicted_light_prior(usual, look_of(usual.mean), np.full(8, 0.1))
    np.testing.assert_allclose(told.mean, usual.mean, atol=1e-12)
    assert light_to_reference(light_from_reference(usual.mean[:9])) == pytest.approx(usual.mean[:9])
