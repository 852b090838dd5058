"""Maps at twice the size."""

import numpy as np
import pytest

from isc_core.imaging.doubling import doubled, doubled_at


def test_a_ramp_stays_a_ramp_inside() -> None:
    ramp = np.tile(np.arange(6.0), (4, 1))
    inner = doubled(ramp)[1:-1, 1:-1]
    np.testing.assert_allclose(np.diff(inner, axis=1), 0.5)


@pytest.mark.parametrize("channels", [(), (3,)])
def test_a_part_is_that_of_the_whole(channels: tuple[int, ...]) -> None:
    values = np.random.default_rng(0).normal(size=(7, 9, *channels))
    whole = doubled(values)
    for rows, columns in ((slice(0, 14), slice(0, 18)), (slice(4, 8), slice(6, 18))):
        assert np.array_equal(doubled_at(values, (rows, columns)), whole[rows, columns])
