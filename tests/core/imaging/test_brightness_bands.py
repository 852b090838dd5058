"""Bands of bright details: their content, and their invariances."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from isc_core.imaging.brightness_bands import brightness_bands

REACHES = (2, 5, 9)


def bands(values: np.ndarray, mask: np.ndarray | None = None) -> np.ndarray:
    mask = np.ones(values.shape, bool) if mask is None else mask
    return np.stack(list(brightness_bands(values, mask, REACHES)))


def test_a_square_lies_in_the_band_of_its_size() -> None:
    for side, band in ((3, 0), (5, 1), (7, 1), (13, 2)):
        values = np.full((60, 60), 0.2)
        values[20 : 20 + side, 20 : 20 + side] = 0.9
        found = bands(values)
        assert_allclose(found[band][20 : 20 + side, 20 : 20 + side], 0.7)
        assert_allclose(found.sum(axis=0), values - 0.2)


def test_bands_are_not_negative_and_leave_what_is_large() -> None:
    rng = np.random.default_rng(0)
    values = rng.random((50, 40))
    values[:, 20:] += 3
    found = bands(values)
    assert (found >= 0).all()
    left = values - found.sum(axis=0)
    assert (left[:, 20:] >= 3).all() and (left[:, :20] < 1).all()


def test_what_lies_outside_the_mask_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    values, mask = rng.random((40, 40)), np.zeros((40, 40), bool)
    mask[8:30, 5:33] = True
    dark, bright = np.where(mask, values, 0), np.where(mask, values, 9)
    assert_array_equal(bands(dark, mask), bands(bright, mask))
    assert not bands(bright, mask)[:, ~mask].any()


def test_bands_turn_with_the_map_and_scale_with_the_light() -> None:
    values = np.random.default_rng(2).random((33, 33)).astype(np.float32)
    turned = np.rot90(bands(values), axes=(1, 2))
    assert_array_equal(bands(np.rot90(values)), turned)
    assert_array_equal(bands(4 * values), 4 * bands(values))
    assert bands(values).dtype == np.float32
