"""Cubic upsampling: exact for ramps, closer to a wave than bilinear, the same in parts."""

import numpy as np

from isc_core.imaging.upsampling import enlarged, enlarged_cubically

SHAPE = (62, 96)


def wave(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    return np.sin(rows / 3)[:, None] * np.cos(columns / 4)


def centres(size: int, factor: float) -> np.ndarray:
    return np.asarray((np.arange(size) + 0.5) / factor - 0.5)


def test_a_ramp_stays_one_and_the_same_size_changes_nothing() -> None:
    ramp = np.arange(31.0)[:, None] + 2 * np.arange(24.0)
    found = enlarged_cubically(ramp, SHAPE)
    expected = centres(62, 2)[:, None] + 2 * centres(96, 4)
    np.testing.assert_allclose(found[4:-4, 8:-8], expected[4:-4, 8:-8], atol=1e-5)
    assert (enlarged_cubically(ramp, ramp.shape) == ramp).all()


def test_a_wave_is_closer_than_by_bilinear_interpolation() -> None:
    coarse = wave(np.arange(31.0), np.arange(48.0))
    fine = wave(centres(62, 2), centres(96, 2))
    inner = slice(4, -4)
    cubic, linear = (
        np.abs(found - fine)[inner, inner].max()
        for found in (enlarged_cubically(coarse, SHAPE), enlarged(coarse, SHAPE, 2))
    )
    assert cubic < linear / 4


def test_rows_are_those_of_the_whole() -> None:
    layer = np.random.default_rng(0).random((31, 24, 3))
    whole = enlarged_cubically(layer, SHAPE)
    assert whole.shape == (*SHAPE, 3)
    assert (enlarged_cubically(layer, SHAPE, slice(7, 20)) == whole[7:20]).all()


def test_all_borders_are_alike_and_repeat_the_outermost_value() -> None:
    layer = np.random.default_rng(1).random((5, 7))
    shape = (15, 35)
    found = enlarged_cubically(layer, shape)
    mirrored = enlarged_cubically(layer[::-1, ::-1], shape)[::-1, ::-1]
    np.testing.assert_allclose(found, mirrored, atol=1e-6)
    ends = [0, 0, -1, -1], [0, -1, 0, -1]
    np.testing.assert_allclose(found[ends], layer[ends], rtol=1e-6)
