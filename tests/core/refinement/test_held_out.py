"""Blocks that are held out: alike in light to those that are not, inside, and the seed's."""

import numpy as np
import pytest

from isc_core.refinement.held_out import held_out_blocks, pixels_of

SHAPE, SIDE = (45, 62), 4


def bright_corner() -> np.ndarray:
    row, column = np.indices(SHAPE)
    return np.exp(-(row + column) / 10)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_they_have_their_share_of_pixels_and_of_light(seed: int) -> None:
    light = bright_corner()
    chosen = pixels_of(held_out_blocks(light, SIDE, 5, seed), SIDE, SHAPE)
    assert chosen.mean() == pytest.approx(0.2, abs=0.02)
    assert light[chosen].sum() / light.sum() == pytest.approx(0.2, abs=0.06)


def test_they_lie_inside_and_depend_on_the_seed() -> None:
    mask = np.hypot(*(np.indices(SHAPE) - np.reshape([22, 31], (2, 1, 1)))) < 20
    blocks = held_out_blocks(bright_corner(), SIDE, 3, 0, mask)
    chosen = pixels_of(blocks, SIDE, SHAPE)
    assert chosen.sum() == len(blocks) * SIDE**2 > 0 and not (chosen & ~mask).any()
    assert np.array_equal(blocks, held_out_blocks(bright_corner(), SIDE, 3, 0, mask))
    assert not np.array_equal(blocks, held_out_blocks(bright_corner(), SIDE, 3, 1, mask))


def test_blocks_at_the_end_are_cut_off() -> None:
    chosen = pixels_of(held_out_blocks(np.ones(SHAPE), SIDE, 1, 0), SIDE, SHAPE)
    assert chosen.all()
