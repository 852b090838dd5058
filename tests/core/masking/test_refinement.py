"""The larger prior of the object."""

import numpy as np
import pytest

from isc_core.masking.refinement import with_larger_prior


def test_log_odds_rise_by_a_constant() -> None:
    """The order of the pixels stays, and so do the certain ones."""
    cover = np.linspace(0, 1, 101, dtype=np.float32)
    likelier = with_larger_prior(cover, 0.5)
    assert likelier.dtype == np.float32
    assert likelier[[0, -1]].tolist() == [0, 1]
    assert np.all(np.diff(likelier) > 0)
    before, after = (np.log(one[1:-1] / (1 - one[1:-1])) for one in (cover, likelier))
    assert after - before == pytest.approx(0.5, abs=1e-3)
