"""Logistic regression: its maximum, its weights, and labels that a plane separates."""

import numpy as np
import pytest
from scipy.special import expit

from isc_core.numerics.logistic import logistic_weights

RIDGE = np.array([0.0, 0.1, 2.0])


def problem(seed: int, count: int = 300) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Features with an offset, labels of known odds, and how much each counts."""
    rng = np.random.default_rng(seed)
    features = np.column_stack([np.ones(count), rng.normal(size=(count, 2)) * (1, 5)])
    labels = rng.random(count) < expit(features @ (0.5, 2.0, -0.3))
    return features, labels, rng.uniform(0, 2, count)


@pytest.mark.parametrize("seed", range(3))
def test_the_gradient_of_the_log_likelihood_vanishes(seed: int) -> None:
    features, labels, weight = problem(seed)
    found = logistic_weights(features, labels, RIDGE, weight)
    gradient = features.T @ (weight * (labels - expit(features @ found))) - RIDGE * found
    assert np.abs(gradient).max() < 1e-9
    assert np.abs(features.T @ (weight * (labels - 0.5))).max() > 10  # at the start


def test_the_weights_of_many_labels_are_those_of_their_odds() -> None:
    features, labels, _ = problem(0, 40_000)
    found = logistic_weights(features, labels)
    np.testing.assert_allclose(found, (0.5, 2.0, -0.3), atol=0.06)


def test_a_weight_of_two_is_the_same_label_twice() -> None:
    features, labels, _ = problem(1, 60)
    twice = np.arange(60) < 20
    again = np.concatenate([np.arange(60), np.flatnonzero(twice)])
    weighted = logistic_weights(features, labels, 0.1, 1.0 + twice)
    np.testing.assert_allclose(
        weighted, logistic_weights(features[again], labels[again], 0.1), rtol=1e-9
    )


def test_separable_labels_need_a_ridge() -> None:
    features = np.column_stack([np.ones(20), np.linspace(-1, 1, 20)])
    labels = features[:, 1] > 0.1
    with pytest.raises(ValueError, match="ridge"):
        logistic_weights(features, labels)
    weights = [logistic_weights(features, labels, ridge)[1] for ridge in (1.0, 1e-3, 1e-6)]
    assert 0 < weights[0] < weights[1] < weights[2] < 1e3


def test_outliers_converge() -> None:
    """Full Newton steps from 0 diverge here."""
    rng = np.random.default_rng(200)
    count = rng.integers(5, 40)
    features = np.column_stack([np.ones(count), rng.standard_cauchy((count, 2)) * 10])
    labels, ridge = rng.random(count) < 0.5, 1e-3
    full = np.zeros(3)
    for _ in range(50):
        share = expit(features @ full)
        curvature = (features.T * (share * (1 - share))) @ features + ridge * np.eye(3)
        full += np.linalg.solve(curvature, features.T @ (labels - share) - ridge * full)
    found = logistic_weights(features, labels, ridge)
    gradients = [features.T @ (labels - expit(features @ w)) - ridge * w for w in (full, found)]
    assert np.abs(gradients[0]).max() > 100 > 1e-9 > np.abs(gradients[1]).max()
