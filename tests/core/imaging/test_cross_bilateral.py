"""Averages that keep to one side of an edge."""

import numpy as np
import pytest

from isc_core.imaging.cross_bilateral import CrossBilateral
from isc_core.imaging.smoothing import low_pass, masked_low_pass

SHAPE = (40, 56)
MASK = np.ones(SHAPE, bool)


def _noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=SHAPE).astype(np.float32)


def test_a_guide_without_edges_gives_the_gaussian_low_pass() -> None:
    smoother = CrossBilateral.of(np.zeros((*SHAPE, 2), np.float32), MASK, 2.0, 0.1)
    inner, values = (slice(16, -16),) * 2, _noise(0)
    assert low_pass(values, smoother)[inner] == pytest.approx(
        masked_low_pass(values, MASK, 2.0)[inner], abs=0.02
    )


def test_the_other_side_of_an_edge_does_not_matter() -> None:
    right = np.broadcast_to(np.arange(SHAPE[1]) >= 30, SHAPE)
    smoother = CrossBilateral.of(right[..., None].astype(np.float32), MASK, 3.0, 0.1)
    values = _noise(1)
    other = np.where(right, 5 + _noise(2), values).astype(np.float32)
    change = low_pass(other, smoother) - low_pass(values, smoother)
    assert np.abs(change[~right]).max() < 1e-5 < np.abs(change[right]).min()


def test_a_step_in_the_guide_is_kept_exactly() -> None:
    step = np.broadcast_to(np.arange(SHAPE[0])[:, None] >= 20, SHAPE).astype(np.float32)
    smoother = CrossBilateral.of(step[..., None], MASK, 3.0, 0.1)
    assert low_pass(step, smoother) == pytest.approx(step, abs=1e-5)


def test_pixels_outside_of_the_mask_do_not_count() -> None:
    mask, values = MASK.copy(), _noise(3)
    mask[:, 40:] = False
    smoother = CrossBilateral.of(np.zeros((*SHAPE, 1), np.float32), mask, 2.0, 0.1)
    other = np.where(mask, values, np.float32(1e3))
    assert np.array_equal(smoother(values)[mask], smoother(other)[mask])
    assert smoother(np.ones(SHAPE, np.float32))[mask] == pytest.approx(1, abs=1e-5)
