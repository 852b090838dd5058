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
def test_the_far_corner_is_outside(mask: np.ndarray) -> None:
    part = FramePart.around(mask, 0)
    assert not part.is_whole
    inside = np.zeros(SHAPE, bool)
    part.cut(inside)[...] = True
    assert inside[part.far_corner].shape == (1, 1)
    assert not inside[part.far_corner].any()


def test_constant_values_around_a_part() -> None:
    part = FramePart.around(spot(5, 9, 20, 31), 3)
    values = np.full(SHAPE, 4.0)
    part.cut(values)[...] = np.arange(17)
    assert part.constant_around(values) == 4
    for row, column in [(0, 0), (39, 59), (5, 2), (5, 58), (1, 25)]:
        other = values.copy()
        other[row, column] = 5
        assert part.constant_around(other) is None
    whole = FramePart.whole(SHAPE)
    assert whole.constant_around(values) == values[0, 0]
