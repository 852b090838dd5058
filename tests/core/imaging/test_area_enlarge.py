"""Enlarging keeps the averages of the old pixels, and is as sharp as a larger photo is."""

import numpy as np
import pytest

from isc_core.imaging.area_enlarge import enlarge_averages
from isc_core.imaging.resampling import resample_inside


def averages_of_waves(size: int, waves: float) -> np.ndarray:
    """Averages (size,) over the pixels of a row of light that rises in waves, from its integral."""
    edges = np.linspace(0, 1, size + 1)
    integral = edges + 4 * edges**2 + 0.1 * np.sin(2 * np.pi * waves * edges) / (2 * np.pi * waves)
    return np.diff(integral) * size


@pytest.mark.parametrize("times", [1, 2, 3, 5])
def test_the_averages_of_the_old_pixels_stay(times: int) -> None:
    """Where no pixel is the darkest around: the values rise from the first corner on."""
    rng = np.random.default_rng(0)
    steps = (rng.uniform(0.5, 1.5, (n, 3)).cumsum(axis=0) for n in (20, 24))
    down, right = steps
    values = down[:, None] + right[None]
    inside = np.ones((20, 24), bool)
    fine = enlarge_averages(values, inside, (20 * times, 24 * times))
    back = fine.reshape(20, times, 24, times, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(back[1:, 1:], values[1:, 1:], rtol=1e-9)


@pytest.mark.parametrize("new", [60, 75, 80, 113])
def test_waves_are_as_high_as_in_a_photo_of_that_size(new: int) -> None:
    """Waves of 6 pixels; interpolated linearly, they lose a tenth and more."""
    inside = np.ones((60, 60), bool)
    small, large = (averages_of_waves(size, 10.0) for size in (60, new))
    values = np.broadcast_to(small[None, :, None], (60, 60, 1))
    fine = enlarge_averages(values, inside, (new, new))[..., 0]
    wrong = np.abs(fine - large)[:, 5:-5].max()
    linear = np.abs(resample_inside(values, inside, new / 60)[0][..., 0] - large)[:, 5:-5].max()
    assert wrong < 0.005
    assert new == 60 or wrong < 0.25 * linear


def test_a_constant_stays_and_no_background_bleeds_in() -> None:
    i, j = np.mgrid[:40, :46]
    inside = np.hypot(i - 20, j - 22) < 15
    values = np.where(inside, 0.7, 9.0)[..., None]
    np.testing.assert_allclose(enlarge_averages(values, inside, (57, 66)), 0.7, rtol=1e-12)


def test_nothing_is_darker_than_the_darkest_pixels_around() -> None:
    """Black print must not become darker: the logarithm amplifies small differences."""
    values = np.full((30, 30, 3), 0.8)
    values[10:20, 12:18] = 0.02
    fine = enlarge_averages(values, np.ones((30, 30), bool), (41, 41))
    assert fine.min() >= 0.02


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (2, 3)])
def test_tiny_images(shape: tuple[int, int]) -> None:
    values = np.full((*shape, 2), 2.0)
    fine = enlarge_averages(values, np.ones(shape, bool), (8, 9))
    np.testing.assert_allclose(fine, 2, rtol=1e-5)
