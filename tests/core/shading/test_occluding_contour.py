"""The occluding contour: on the rim, pointing outward, blind to padding, absent where the frame
cuts the object.
"""

import numpy as np
import pytest

from isc_core.shading.occluding_contour import RADIUS, occluding_contour


def disc(shape: tuple[int, int], center: tuple[float, float], radius: float) -> np.ndarray:
    i, j = np.mgrid[: shape[0], : shape[1]]
    return np.hypot(i - center[0], j - center[1]) <= radius


def test_a_disc_points_outward() -> None:
    contour = occluding_contour(disc((90, 96), (44.3, 47.6), 32))
    away = np.stack([contour.rows - 44.3, contour.columns - 47.6])
    radius = np.hypot(*away)
    assert len(contour.rows) > 150
    assert (np.abs(radius - 32) < 1.5).all()
    cosine = (contour.down * away[0] + contour.right * away[1]) / radius
    sine = (contour.down * away[1] - contour.right * away[0]) / radius
    error = np.degrees(np.arctan2(sine, cosine))
    assert np.abs(error).mean() < 4 and abs(error.mean()) < 0.5
    assert (
        np.abs(error).max() < 9
    )  # the window sees the pixels' stairs: where they turn it is off by so much
    np.testing.assert_allclose(np.hypot(contour.down, contour.right), 1, atol=1e-12)


def test_only_pixels_with_an_outside_neighbour_are_on_it() -> None:
    mask = disc((40, 40), (20, 20), 12)
    contour = occluding_contour(mask)
    outside = ~mask
    near = np.zeros_like(mask)
    for axis in (0, 1):
        for step in (-1, 1):
            near |= np.roll(outside, step, axis)
    have = np.zeros_like(mask)
    have[contour.rows, contour.columns] = True
    np.testing.assert_array_equal(have, mask & near)


@pytest.mark.parametrize("pad", [1, 3, 17])
def test_padding_changes_nothing(pad: int) -> None:
    mask = disc((31, 33), (15, 16), 14)
    plain, padded = occluding_contour(mask), occluding_contour(np.pad(mask, pad))
    np.testing.assert_array_equal(plain.rows + pad, padded.rows)
    np.testing.assert_array_equal(plain.columns + pad, padded.columns)
    np.testing.assert_array_equal(plain.down, padded.down)
    np.testing.assert_array_equal(plain.right, padded.right)


def test_where_the_frame_cuts_the_object_there_is_none() -> None:
    whole = disc((60, 60), (30, 30), 20)
    cut = whole[30:]
    contour, full = occluding_contour(cut), occluding_contour(whole)
    assert (contour.rows > RADIUS).all()
    far = full.rows - 30 > RADIUS
    np.testing.assert_array_equal(contour.rows, full.rows[far] - 30)
    np.testing.assert_array_equal(contour.down, full.down[far])
    np.testing.assert_array_equal(contour.right, full.right[far])


def test_the_published_rule_drops_all_points_near_the_frame() -> None:
    contour = occluding_contour(disc((31, 33), (15, 16), 14), drop_near_edge=True)
    assert len(contour.rows) and contour.rows.min() >= 5 and contour.rows.max() < 26
    assert contour.columns.min() >= 5 and contour.columns.max() < 28


def test_masks_without_a_direction_give_no_points() -> None:
    assert len(occluding_contour(np.zeros((9, 9), bool)).rows) == 0
    assert len(occluding_contour(np.ones((9, 9), bool)).rows) == 0
    single = np.zeros((9, 9), bool)
    single[4, 4] = True
    assert len(occluding_contour(single).rows) == 0
