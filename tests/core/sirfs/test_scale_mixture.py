"""Densities of the scale mixtures, which leave out what underflows."""

import numpy as np

from isc_core.sirfs.priors.scale_mixture import exp_or_zero


def test_what_underflows_is_zero_as_in_the_exponential() -> None:
    exponent = -np.concatenate([np.linspace(0, 2000, 4001), np.linspace(744, 747, 3001), [np.inf]])
    wanted = np.exp(exponent)
    assert np.array_equal(exp_or_zero(exponent), wanted)
    assert 0 < wanted[wanted > 0].min() < 1e-320  # least numbers are among them
