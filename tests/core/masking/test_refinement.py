"""The larger prior of the object, and crops of any shape."""

import numpy as np
import pytest

from isc_core.masking.refinement import refined, with_larger_prior


def test_log_odds_rise_by_a_constant() -> None:
    """The order of the pixels stays, and so do the certain ones."""
    cover = np.linspace(0, 1, 101, dtype=np.float32)
    likelier = with_larger_prior(cover, 0.5)
    assert likelier.dtype == np.float32
    assert likelier[[0, -1]].tolist() == [0, 1]
    assert np.all(np.diff(likelier) > 0)
    before, after = (np.log(one[1:-1] / (1 - one[1:-1])) for one in (cover, likelier))
    assert after - before == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("shape", [(1, 900), (900, 1), (2, 1600)])
def test_a_strip_has_a_mask(shape: tuple[int, int]) -> None:
    light = np.full((*shape, 3), 0.1, np.float32)
    cover: np.ndarray = np.zeros(shape, np.float32)
    inside = tuple(slice(0, n) if n < 4 else slice(n // 4, 3 * n // 4) for n in shape)
    light[inside], cover[inside] = 0.8, 1
    found = refined(light, cover, np.zeros(shape, np.int8))
    assert found.shape == shape
    assert np.mean((found > 0.5) == (cover > 0.5)) > 0.98
