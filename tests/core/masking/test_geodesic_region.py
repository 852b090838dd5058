"""Regions that change around points: up to an edge of the photo, and no further."""

import numpy as np
import pytest

from isc_core.masking.geodesic_region import with_changed_regions

SHAPE = (40, 60)


def two_colours() -> np.ndarray:
    """A picture whose left and right halves differ, with a little noise."""
    codes = np.full((*SHAPE, 3), 0.3)
    codes[:, 30:] = 0.7
    return codes + np.random.default_rng(0).normal(0, 0.005, codes.shape)


def boxes(*columns: tuple[int, int]) -> np.ndarray:
    mask = np.zeros(SHAPE, bool)
    for first, last in columns:
        mask[5:35, first:last] = True
    return mask


def test_a_point_on_the_background_removes_its_side_of_an_edge() -> None:
    mask = boxes((10, 50))
    changed = with_changed_regions(two_colours(), mask, [], [(20, 45)])
    assert not changed[:, 31:].any()
    assert (changed[:, :29] == mask[:, :29]).all()


def test_a_point_on_the_object_adds_its_side_of_an_edge() -> None:
    codes = np.full((*SHAPE, 3), 0.3)
    codes[5:35, 10:50] = 0.7
    changed = with_changed_regions(codes, boxes((10, 20)), [(20, 45)], [])
    assert (changed == boxes((10, 50))).all()


def test_a_point_of_the_other_kind_holds_the_border() -> None:
    """Without an edge, the region ends half way to a point of the other kind."""
    codes, mask = np.full((*SHAPE, 3), 0.5), boxes((10, 50))
    alone = with_changed_regions(codes, mask, [], [(20, 40)])
    held = with_changed_regions(codes, mask, [(20, 36)], [(20, 40)])
    assert not alone[20, 36:45].any()
    assert held[20, :38].sum() == mask[20, :38].sum() and not held[20, 39:45].any()


@pytest.mark.parametrize("points", [([(20, 20)], []), ([], [(1, 1)]), ([(20, 20)], [(1, 1)])])
def test_points_that_agree_change_nothing(
    points: tuple[list[tuple[int, int]], list[tuple[int, int]]],
) -> None:
    mask = boxes((10, 50))
    assert (with_changed_regions(two_colours(), mask, *points) == mask).all()


def test_pixels_that_are_not_connected_to_the_point_stay() -> None:
    mask = boxes((5, 15), (40, 55))
    changed = with_changed_regions(np.full((*SHAPE, 3), 0.5), mask, [], [(20, 10)])
    assert (changed[:, 40:] == mask[:, 40:]).all()
    assert not changed[20, 10]


def test_a_mirrored_photo_gives_the_mirrored_mask() -> None:
    codes, mask = two_colours(), boxes((10, 50))
    changed = with_changed_regions(codes, mask, [(20, 55)], [(20, 45)])
    mirrored = with_changed_regions(codes[:, ::-1], mask[:, ::-1], [(20, 4)], [(20, 14)])
    assert (mirrored[:, ::-1] == changed).all()
