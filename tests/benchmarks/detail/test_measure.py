"""The measure of detail on fields whose answer is known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.detail.measure import at_size, fine_normals, score_relief, scored_pixels

SIDE, LENGTH = 480, 430  # half of the measured photos


def ball() -> tuple[np.ndarray, np.ndarray]:
    """Normals of a ball, and its mask."""
    across = (np.arange(SIDE) + 0.5 - SIDE / 2) / (LENGTH / 2)
    x, y = np.meshgrid(across, -across)
    square = x**2 + y**2
    mask = square < 1
    z = np.sqrt(np.maximum(1 - square, 0))
    return np.dstack([x, y, z]) * mask[..., None], mask


def with_waves(normal: np.ndarray, mask: np.ndarray, wavelength: float, slope: float) -> np.ndarray:
    """Tilt normals by waves across the picture; the wavelength is for an object 860 long."""
    period = wavelength * LENGTH / 860
    tilt = slope * np.sin(2 * np.pi / period * np.arange(SIDE)) * np.ones((SIDE, 1))
    across = np.dstack([normal[..., 2], np.zeros_like(tilt), -normal[..., 0]])
    found = normal + tilt[..., None] * across
    return found / np.maximum(np.linalg.norm(found, axis=2, keepdims=True), 1e-9) * mask[..., None]


def test_the_truth_explains_everything_and_the_smooth_body_nothing() -> None:
    smooth, mask = ball()
    truth = with_waves(smooth, mask, 16, 0.1)
    perfect, nothing = (score_relief(one, truth, mask, smooth) for one in (truth, smooth))
    assert perfect.explained == pytest.approx((1, 1, 1))
    assert perfect.base == pytest.approx(0, abs=1e-3)
    assert nothing.explained[0] == pytest.approx(0, abs=0.02)
    assert nothing.error[0] == pytest.approx(nothing.energy[0], rel=0.02)


def test_relief_the_wrong_way_round_is_worse_than_none() -> None:
    smooth, mask = ball()
    truth, inverse = (with_waves(smooth, mask, 16, s) for s in (0.1, -0.1))
    assert score_relief(inverse, truth, mask, smooth).explained[0] == pytest.approx(-3, abs=0.1)


@pytest.mark.parametrize(("octave", "wavelength"), [(0, 16), (1, 8)])
def test_waves_are_in_their_octave(octave: int, wavelength: float) -> None:
    smooth, mask = ball()
    fine = fine_normals(with_waves(smooth, mask, wavelength, 0.1), mask)
    scored = scored_pixels(mask, mask, smooth)
    energy = np.square(fine[:, scored]).sum(-1).mean(-1)
    assert energy[octave] > 0.9 * energy.sum()


def test_detail_is_scored_apart_from_the_overall_shape() -> None:
    smooth, mask = ball()
    truth = with_waves(smooth, mask, 16, 0.1)
    tilted = truth @ Rotation.from_euler("y", 8, degrees=True).as_matrix().T
    found = score_relief(tilted, truth, mask, smooth)
    assert 6 < found.base < 8  # less where a normal lies along the axis
    assert found.explained[0] > 0.95


def test_a_fold_of_the_body_does_not_count() -> None:
    smooth, mask = ball()
    folded = smooth.copy()
    folded[:, SIDE // 2 :] = (0.6, 0, 0.8)
    folded *= mask[..., None]
    scored = scored_pixels(mask, mask, folded)
    assert scored_pixels(mask, mask, smooth)[SIDE // 2, SIDE // 2]
    assert not scored[:, SIDE // 2 - 3 : SIDE // 2 + 3].any()
    assert scored.any()


def test_a_smaller_estimate_is_brought_to_the_photo_in_place() -> None:
    smooth, mask = ball()
    middle = np.stack([smooth[i::2, j::2] for i in (0, 1) for j in (0, 1)]).mean(0)
    inside = np.linalg.norm(middle, axis=2) > 0.99
    found = at_size(middle, inside, mask.shape)
    scored = scored_pixels(mask, found[..., 2] > 0, smooth)
    cosine = (found * smooth).sum(2)[scored]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.2
