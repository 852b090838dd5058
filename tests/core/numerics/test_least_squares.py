"""Robust least squares: SciPy's minima, bounds kept, outliers ignored."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from isc_core.numerics.least_squares import robust_least_squares

FREE = (np.full(3, -np.inf), np.full(3, np.inf))
TRUE = np.array([2.0, 1.5, 0.3])
PLACES = np.linspace(0, 4, 200)


def decay(x: np.ndarray) -> np.ndarray:
    return x[0] * np.exp(-x[1] * PLACES) + x[2]


def measured(seed: int, outliers: int = 20) -> np.ndarray:
    rng = np.random.default_rng(seed)
    values = decay(TRUE) + rng.normal(0, 0.02, PLACES.size)
    values[rng.choice(PLACES.size, outliers, replace=False)] += rng.uniform(1, 3, outliers)
    return values


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("low", "high"),
    [
        ([-np.inf] * 3, [np.inf] * 3),
        ([0, 0, 0.35], [np.inf] * 3),  # a bound that holds at the minimum
        ([0, 1.7, 0], [1.8, 2, 0.2]),
    ],
)
def test_it_finds_the_minimum_that_scipy_finds(
    seed: int, low: list[float], high: list[float]
) -> None:
    values = measured(seed)
    bounds = np.array(low), np.array(high)
    start = np.clip([1.0, 1.0, 0.0], *bounds)
    found = robust_least_squares(lambda x: decay(x) - values, start, bounds, 0.05)
    inner = np.clip(start, bounds[0] + 1e-3, bounds[1] - 1e-3)  # SciPy starts inside the bounds
    theirs = least_squares(
        lambda x: decay(x) - values,
        inner,
        bounds=bounds,
        loss="soft_l1",
        f_scale=0.05,
        ftol=1e-12,
        xtol=1e-12,
        gtol=1e-12,
    ).x
    assert (found >= bounds[0]).all() and (found <= bounds[1]).all()
    np.testing.assert_allclose(found, theirs, atol=2e-4)


def test_outliers_do_not_count() -> None:
    values = measured(7, outliers=40)
    found = robust_least_squares(lambda x: decay(x) - values, np.ones(3), FREE, 0.02)
    np.testing.assert_allclose(found, TRUE, atol=0.05)


def test_a_parameter_without_effect_stays() -> None:
    values = measured(3)
    found = robust_least_squares(
        lambda x: decay(np.array([x[0], 1.5, x[2]])) - values, np.array([1, 0.7, 0]), FREE, 0.05
    )
    assert found[1] == 0.7
    np.testing.assert_allclose(found[[0, 2]], TRUE[[0, 2]], atol=0.03)


def test_a_start_at_the_minimum_stays() -> None:
    found = robust_least_squares(lambda x: decay(x) - decay(TRUE), TRUE, FREE, 0.05)
    np.testing.assert_array_equal(found, TRUE)


def test_a_start_outside_is_moved_to_the_bounds_and_a_point_stays_one() -> None:
    point = np.full(3, 0.5), np.full(3, 0.5)
    found = robust_least_squares(lambda x: decay(x) - decay(TRUE), np.zeros(3), point, 0.05)
    np.testing.assert_array_equal(found, point[0])
