"""A photo cropped to its object is distinguished from a frame that cuts the object."""

import numpy as np

from isc_core.imaging.framing import continued, cut_line, is_cut


def disc(size: int, radius: float, center: tuple[float, float]) -> np.ndarray:
    i, j = np.mgrid[:size, :size]
    return (i - center[0]) ** 2 + (j - center[1]) ** 2 <= radius**2


def test_a_disc_trimmed_to_its_box_is_whole() -> None:
    mask = disc(101, 50, (50, 50))
    assert mask[0].any()
    assert not cut_line(mask).any()
    assert np.array_equal(continued(mask, 10, 10, 10, 10), np.pad(mask, 10))


def test_a_disc_cut_through_its_centre_is_extended() -> None:
    mask = disc(101, 40, (0, 50))
    assert np.array_equal(cut_line(mask), mask[0])
    grown = continued(mask, 7, 3, 2, 2)
    assert (grown[:7, 2:-2] == mask[0]).all()
    assert not grown[-3:].any()
    assert np.array_equal(grown[7:-3, 2:-2], mask)


def test_each_side_is_judged_alone() -> None:
    mask = disc(101, 50, (50, 50))[:, :60]  # trimmed above, below and on the left; cut on the right
    grown = continued(mask, 4, 4, 4, 4)
    assert not grown[:4].any()
    assert not grown[-4:].any()
    assert not grown[:, :4].any()
    assert (grown[4:-4, -4:] == mask[:, -1:]).all()


def test_a_full_frame_is_extended_on_all_sides() -> None:
    assert continued(np.ones((20, 30), bool), 3, 3, 3, 3).all()


def test_whole_discs_are_not_cut_and_halves_are_on_any_side() -> None:
    whole, half = disc(101, 50, (50, 50)), disc(101, 50, (50, 50))[40:]
    assert not is_cut(whole) and not is_cut(np.pad(half, 1))
    assert all(is_cut(np.rot90(half, turn)) for turn in range(4))
