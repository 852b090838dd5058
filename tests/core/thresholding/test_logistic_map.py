"""The logistic map: known orbits and ends, its density, and how uniform and independent the numbers
made from it are.
"""

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from isc_core.errors import InputError
from isc_core.thresholding.logistic_map import (
    DEGENERATE,
    ChaoticNumbers,
    bifurcation,
    density,
    orbit,
    uniformised,
)


def dependence(numbers: np.ndarray, lag: int = 1) -> float:
    """The p-value of independence between numbers `lag` apart, on a grid of 16 x 16."""
    counts = np.histogram2d(
        numbers[:-lag:2], numbers[lag::2][: len(numbers[:-lag:2])], 16, [[0, 1], [0, 1]]
    )[0]
    return float(chisquare(counts.ravel()).pvalue)


def test_orbit_follows_its_closed_form() -> None:
    angle = 0.3
    values = orbit(np.sin(angle) ** 2, 20)
    assert values == pytest.approx(np.sin(2.0 ** np.arange(20) * angle) ** 2, abs=1e-8)


def test_bifurcation_ends_where_theory_says() -> None:
    fixed, pair, quad = bifurcation(np.array([2.9, 3.2, 3.5])).T
    assert fixed == pytest.approx(1 - 1 / 2.9)
    low_high = (4.2 + np.array([-1, 1]) * np.sqrt(4.2 * 0.2)) / 6.4  # the two-cycle at r = 3.2
    assert np.unique(pair.round(9)) == pytest.approx(low_high)
    assert len(np.unique(quad.round(9))) == 4
    assert len(np.unique(bifurcation(np.array([4.0]), keep=150).round(6))) > 100


def test_density_and_uniformisation() -> None:
    values = orbit(0.1234, 200_000)
    edges = np.linspace(0, 1, 21)
    share = np.histogram(values, edges)[0] / len(values)
    assert share == pytest.approx(np.diff(2 / np.pi * np.arcsin(np.sqrt(edges))), abs=3e-3)
    middle = np.linspace(0.0005, 0.9995, 1000)
    assert density(middle).mean() == pytest.approx(1, abs=0.03)
    assert np.histogram(uniformised(values), edges)[0] / len(values) == pytest.approx(
        0.05, abs=2e-3
    )
    # In u, the map is a tent.
    u = uniformised(values)
    assert u[1:1000] == pytest.approx(1 - np.abs(1 - 2 * u[:999]), abs=1e-7)


def test_numbers_are_uniform_and_independent_where_the_raw_orbit_is_not() -> None:
    numbers = ChaoticNumbers(5).uniform((300_000,))
    assert numbers.min() >= 0 and numbers.max() < 1
    assert kstest(numbers, "uniform").pvalue > 1e-3
    for lag in (1, 3, 1023, 1025):
        assert dependence(numbers, lag) > 1e-3
    apart = numbers[: 1024 * 290].reshape(
        290, 1024
    )  # an orbit's own numbers, one refill after the other
    pairs = np.histogram2d(apart[:-1:2].ravel(), apart[1::2].ravel(), 16, [[0, 1], [0, 1]])[0]
    assert chisquare(pairs.ravel()).pvalue > 1e-3
    assert dependence(uniformised(orbit(0.1234, 300_000))) < 1e-100


def test_seeds_repeat_and_differ() -> None:
    first, again, other = (ChaoticNumbers(seed).uniform((5000,)) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert abs(np.corrcoef(first, other)[0, 1]) < 0.06
    pieces = ChaoticNumbers(1)
    assert np.array_equal(
        np.concatenate([pieces.uniform((7, 3)).ravel(), pieces.uniform((979,))]), first[:1000]
    )


@pytest.mark.slow
def test_orbits_that_stop_are_started_again() -> None:
    """In floating point one orbit in some 1e8 steps falls on a point where it stops."""
    count = 4096
    numbers = ChaoticNumbers(0, orbits=count, stride=20_000).uniform((6 * count,))
    assert len(np.unique(numbers)) > 6 * count - 3
    assert not np.isin(numbers.reshape(6, count)[-1], uniformised(np.array(DEGENERATE))).any()


def test_degenerate_starts_are_rejected() -> None:
    for start in (*DEGENERATE, -0.1, 1.2):
        with pytest.raises(InputError, match="orbit must start"):
            orbit(start, 10)
    with pytest.raises(InputError, match="rates above 0"):
        orbit(0.3, 10, rate=4.1)
    for bad in ({"seed": -1}, {"seed": 0, "orbits": 0}, {"seed": 0, "stride": 0}):
        with pytest.raises(InputError, match="chaotic numbers"):
            ChaoticNumbers(**bad)
