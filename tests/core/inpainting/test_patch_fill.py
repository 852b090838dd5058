"""Patch filling: what it must continue, what it must not touch or read, and what it does without
any source patch.
"""

import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.inpainting.coherency_sensitive_hashing import CshOptions
from isc_core.inpainting.patch_fill import PatchFillOptions, fill_patches
from isc_core.inpainting.pull_push import fill
from isc_core.progress import Monitor


def checks(height: int, width: int) -> np.ndarray:
    """A tiled pattern (height, width, 3) of two colours with edges in two directions, period 12."""
    y, x = np.mgrid[:height, :width]
    light = ((y // 6 + x // 6) % 2)[..., None]
    return np.where(light == 1, [0.8, 0.6, 0.2], [0.1, 0.3, 0.5])


def disc(height: int, width: int, y: float, x: float, radius: float) -> np.ndarray:
    rows, columns = np.mgrid[:height, :width]
    return np.hypot(rows - y, columns - x) < radius


def test_a_pattern_continues_into_the_hole() -> None:
    image = checks(96, 110)
    hole = disc(96, 110, 45, 60, 9)
    filled = fill_patches(image, ~hole, hole)
    error = np.mean((filled - image)[hole] ** 2)
    assert error < 0.1 * np.mean((fill(image, ~hole) - image)[hole] ** 2)
    assert np.array_equal(filled[~hole], image[~hole].astype(np.float32))


def test_a_constant_stays_one() -> None:
    image = np.full((50, 60, 3), 0.37)
    hole = disc(50, 60, 20, 20, 12)
    assert np.abs(fill_patches(image, ~hole, hole) - 0.37).max() < 1e-6


def test_values_lie_within_those_of_the_sources() -> None:
    image = np.random.default_rng(1).random((64, 64, 3))
    hole = disc(64, 64, 30, 30, 8)
    filled = fill_patches(image, ~hole, hole)
    assert filled.min() >= image[~hole].min() - 1e-6 and filled.max() <= image[~hole].max() + 1e-6


def test_unknown_pixels_are_never_read() -> None:
    image = checks(70, 80)
    hole, known = disc(70, 80, 30, 40, 7), disc(70, 80, 35, 40, 32)
    known &= ~hole
    poisoned = np.where(known[..., None], image, np.nan)
    first, second = fill_patches(image, known, hole), fill_patches(poisoned, known, hole)
    assert np.array_equal(first, second) and np.isfinite(first).all()


def test_the_seed_decides() -> None:
    image = np.random.default_rng(2).random((60, 60, 3))
    hole = disc(60, 60, 30, 30, 9)
    options = [PatchFillOptions(matching=CshOptions(tables=1, seed=seed)) for seed in (4, 4, 5)]
    first, again, other = (fill_patches(image, ~hole, hole, each) for each in options)
    assert np.array_equal(first, again) and not np.array_equal(first, other)


@pytest.mark.parametrize("shape", [(5, 5), (9, 40), (40, 17), (33, 31)])
def test_small_frames_and_thin_sources_are_filled_smoothly(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(3).random((*shape, 3))
    known = np.zeros(shape, bool)
    known[:, ::3] = True
    filled = fill_patches(image, known, ~known)
    assert np.isfinite(filled).all() and filled.min() >= 0 and filled.max() <= 1
    assert np.array_equal(filled[known], image[known].astype(np.float32))


def test_a_hole_at_the_corner_and_one_channel() -> None:
    image = checks(60, 60)[..., :1]
    hole = disc(60, 60, 0, 0, 10)
    assert np.isfinite(fill_patches(image, ~hole, hole)).all()


def test_reports_and_stops() -> None:
    image = checks(60, 60)
    hole = disc(60, 60, 30, 30, 8)
    seen: list[float] = []
    fill_patches(image, ~hole, hole, monitor=Monitor(lambda event: seen.append(event.fraction)))
    assert seen == sorted(seen) and len(seen) > 3 and 0 <= seen[0] <= seen[-1] <= 1
    with pytest.raises(Cancelled):
        fill_patches(image, ~hole, hole, monitor=Monitor(cancelled=lambda: True))


def test_refuses_what_it_cannot_fill() -> None:
    image, hole = checks(30, 30), disc(30, 30, 15, 15, 5)
    with pytest.raises(InputError, match="known pixels"):
        fill_patches(image, np.zeros_like(hole), hole)
    with pytest.raises(InputError, match="known and missing"):
        fill_patches(image, np.ones_like(hole), hole)
    with pytest.raises(InputError, match="iterations"):
        fill_patches(image, ~hole, hole, PatchFillOptions(iterations=0))
