"""Tiles and blocks of rows: they cover what is there, and a whole map follows from its parts."""

import numpy as np
import pytest
from scipy import ndimage

from isc_core.errors import InputError
from isc_core.imaging.row_blocks import row_blocks
from isc_core.imaging.tiles import tiles_of


@pytest.mark.parametrize("shape", [(1, 5), (7, 3), (64, 40), (200, 1000)])
@pytest.mark.parametrize("pixels", [1, 90, 1 << 18])
def test_blocks_of_rows_give_the_whole_map(shape: tuple[int, int], pixels: int) -> None:
    values = np.random.default_rng(0).normal(size=shape)
    smooth, seen = np.empty_like(values), np.zeros(shape[0], int)
    for block in row_blocks(shape, halo=6, pixels=pixels):
        smooth[block.rows] = ndimage.gaussian_filter(values[block.wide], 1.5)[block.own]
        seen[block.rows] += 1
    assert (seen == 1).all()
    np.testing.assert_array_equal(smooth, ndimage.gaussian_filter(values, 1.5))


@pytest.mark.parametrize("side", [16, 40, 96, 400])
def test_tiles_cover_the_object_once(side: int) -> None:
    rng = np.random.default_rng(1)
    i, j = np.mgrid[:160, :240]
    mask = (np.hypot(i - 70, j - 130) < 55) | (rng.random((160, 240)) < 2e-4)
    seen = np.zeros(mask.shape, int)
    for tile in tiles_of(mask, side, 16, 8):
        seen[tile.inner] += 1
        assert np.array_equal(seen[tile.outer][tile.own], seen[tile.inner])
        for inner, outer, size in zip(tile.inner, tile.outer, mask.shape, strict=True):
            assert inner.start % 8 == inner.stop % 8 == outer.start % 8 == outer.stop % 8 == 0
            assert 0 < inner.stop - inner.start <= side
            assert outer.start == max(inner.start - 16, 0)
            assert outer.stop == min(inner.stop + 16, size)
    assert seen.max() == 1 and seen[mask].all() and not seen.all()


def test_no_tiles_without_an_object_and_none_smaller_than_their_overlap() -> None:
    assert not list(tiles_of(np.zeros((32, 32), bool), 16, 16, 8))
    with pytest.raises(InputError, match="tiles of 8 pixels are smaller than their overlap of 16"):
        list(tiles_of(np.ones((32, 32), bool), 8, 16, 8))
