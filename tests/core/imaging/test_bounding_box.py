"""Boxes of masks, and parts of frames."""

import numpy as np
import pytest

from isc_core.imaging.bounding_box import FramePart, mask_box, mask_slices

SHAPE = (40, 60)


def spot(top: int, bottom: int, left: int, right: int) -> np.ndarray:
    mask = np.zeros(SHAPE, bool)
    mask[top:bottom, left:right] = True
    return mask


def test_the_box_is_the_smallest() -> None:
    mask = spot(5, 9, 20, 31)
    assert mask_box(mask) == (20, 5, 11, 4)
    rows, columns = mask_slices(mask, 8)
    assert (rows, columns) == (slice(0, 17), slice(12, 39))


def test_a_part_is_cut_and_placed_again() -> None:
    part = FramePart.around(spot(5, 9, 20, 31), 3)
    values = np.random.default_rng(0).normal(size=(*SHAPE, 2))
    near = part.cut(values)
    assert near.shape == (10, 17, 2)
    assert np.shares_memory(near, values)
    placed = part.placed(near, np.array([7.0, 8.0]))
    np.testing.assert_array_equal(part.cut(placed), near)
    outside = np.ones(SHAPE, bool)
    part.cut(outside)[...] = False
    assert (placed[outside] == (7, 8)).all()
    assert not part.placed(near)[outside].any()


def test_values_beyond_the_part_are_left_out() -> None:
    part = FramePart(slice(36, 40), slice(57, 60), SHAPE)
    placed = part.placed(np.arange(20.0).reshape(5, 4))
    np.testing.assert_array_equal(part.cut(placed), np.arange(20.0).reshape(5, 4)[:4, :3])


def test_a_part_of_more_than_half_is_the_whole_frame() -> None:
    whole = FramePart.around(spot(2, 38, 2, 40), 0)
    assert whole.is_whole
    assert whole.share == 1
    values = np.zeros(SHAPE)
    assert whole.placed(values) is values
    assert FramePart.around(np.zeros(SHAPE, bool), 3).is_whole


@pytest.mark.parametrize(
    "mask", [spot(0, 10, 0, 60), spot(30, 40, 0, 60), spot(0, 40, 0, 9), spot(20, 40, 20, 60)]
)
def test_a_part_at_the_border_is_not_the_whole_frame(mask: np.ndarray) -> None:
    assert not FramePart.around(mask, 0).is_whole
