"""Densities of the scale mixtures, which leave out what underflows."""

import numpy as np
import pytest

from isc_core.sirfs.priors.scale_mixture import (
    exp_or_zero,
    summed_exponentials,
    summed_exponentials_of_nodes,
)


def test_what_underflows_is_zero_as_in_the_exponential() -> None:
    exponent = -np.concatenate([np.linspace(0, 2000, 4001), np.linspace(744, 747, 3001), [np.inf]])
    wanted = np.exp(exponent)
    assert np.array_equal(exp_or_zero(exponent), wanted)
    assert 0 < wanted[wanted > 0].min() < 1e-320  # least numbers are among them


def test_a_sum_of_exponentials_does_not_depend_on_the_order() -> None:
    rng = np.random.default_rng(0)
    x = np.concatenate([[0.0, 0.0, 40.0], rng.uniform(0, 40, 297)]).reshape(3, 100)
    scales, factors = np.geomspace(1e-4, 30, 12), rng.uniform(0, 1, 12)
    wanted = (factors * np.exp(-x[..., None] / scales)).sum(axis=-1)
    found = summed_exponentials(x, scales, factors)
    np.testing.assert_allclose(found, wanted, rtol=1e-13)
    np.testing.assert_array_equal(summed_exponentials(x.T, scales, factors), found.T)
    assert summed_exponentials(np.zeros((0, 2)), scales, factors).shape == (0, 2)


@pytest.mark.parametrize("count", [1, 2, 9, 10, 999])
def test_the_sum_at_nodes_is_that_of_their_values(count: int) -> None:
    scales, factors = np.geomspace(1e-4, 30, 12), np.linspace(0.1, 1, 12)
    found = summed_exponentials_of_nodes(0.05, count, scales, factors)
    wanted = summed_exponentials(0.05 * np.arange(count), scales, factors)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
