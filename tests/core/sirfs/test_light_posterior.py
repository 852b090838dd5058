"""A light's prior multiplied by a predicted Gaussian: what it must become, and what must stay."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.scene.light_coefficients_estimate import LightCoefficientsEstimate
from isc_core.shading.spherical_harmonics import light_from_reference
from isc_core.sirfs.priors.light_posterior import light_posterior
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.priors.priors import LightPrior

RNG = np.random.default_rng(4)
MIXING = RNG.normal(size=(27, 27)) * 0.05
SEEN = LightCoefficientsEstimate(RNG.normal(0, 0.5, (9, 3)), MIXING @ MIXING.T + 0.02 * np.eye(27))


def prior(channels: int) -> LightPrior:
    return shipped_prior_set().priors("natural", channels).light


def ours(stacked: np.ndarray) -> np.ndarray:
    """Stacked reference coefficients (9 C,) as ISC's (9, C)."""
    return light_from_reference(stacked.reshape(-1, 9).T)


@pytest.mark.parametrize("channels", [1, 3])
def test_who_is_sure_is_believed_but_for_brightness_and_who_is_not_is_not(channels: int) -> None:
    usual = prior(channels)
    sure, unsure = (light_posterior(usual, SEEN, t) for t in (1e-7, 1e9))
    want = SEEN.mean if channels == 3 else SEEN.mean.mean(axis=1, keepdims=True)
    off = ours(sure.mean) - want
    np.testing.assert_allclose(off[1:], 0, atol=1e-4)
    np.testing.assert_allclose(off[0], off[0].mean(), atol=1e-4)
    np.testing.assert_allclose(unsure.mean, usual.mean, atol=1e-4)
    np.testing.assert_allclose(unsure.covariance, usual.covariance, atol=1e-5)


def test_brightness_is_not_taken_from_the_prediction() -> None:
    brighter = SEEN.brighter(np.full(3, 2.0))
    usual = prior(3)
    np.testing.assert_allclose(
        light_posterior(usual, brighter).mean, light_posterior(usual, SEEN).mean, atol=0.01
    )
    redder = SEEN.brighter(np.array([0.3, 0, -0.3]))
    assert np.abs(light_posterior(usual, redder).mean - light_posterior(usual, SEEN).mean).max() > (
        0.02
    )


def test_precisions_add() -> None:
    usual, told = prior(3), light_posterior(prior(3), SEEN)
    once = light_posterior(usual, SEEN, 0.5)
    twice = light_posterior(told, SEEN)
    np.testing.assert_allclose(twice.mean, once.mean, atol=1e-3)
    assert (np.linalg.eigvalsh(usual.covariance - told.covariance) > -1e-12).all()
    assert np.linalg.eigvalsh(told.covariance).min() > 0


def test_a_light_of_the_prior_is_left_alone() -> None:
    usual = prior(3)
    told = light_posterior(usual, replace(SEEN, mean=ours(usual.mean)))
    np.testing.assert_allclose(told.mean, usual.mean, atol=1e-10)
    assert np.array_equal(told.offset, told.mean)
