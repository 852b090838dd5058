"""Means over blocks."""

import numpy as np
import pytest

from isc_core.imaging.blocks import block_means, means_inside


@pytest.mark.parametrize("channels", [(), (3,)])
def test_what_is_outside_of_the_mask_does_not_count(channels: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    values, mask = rng.normal(size=(12, 9, *channels)), rng.random((12, 9)) < 0.5
    mask[:3, :3] = False
    means, share = means_inside(np.where(mask.T, values.T, np.nan).T, mask, 3)
    assert means.shape == (4, 3, *channels) and not means[0, 0].any() and share[0, 0] == 0
    for row, column in np.argwhere(share > 0):
        place = (slice(3 * row, 3 * row + 3), slice(3 * column, 3 * column + 3))
        inside = values[place][mask[place]]
        assert np.allclose(means[row, column], inside.mean(axis=0))
        assert share[row, column] == pytest.approx(len(inside) / 9)


def test_a_full_mask_gives_the_means_of_the_blocks() -> None:
    values = np.random.default_rng(1).random((8, 6, 2)).astype(np.float32)
    means, share = means_inside(values, np.ones((8, 6), bool), 2)
    assert np.array_equal(means, block_means(values, 2)) and (share == 1).all()
    assert means.dtype == np.float32
