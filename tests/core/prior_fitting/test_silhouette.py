"""The silhouette's profile: what a ball's normals do behind their outline is known."""

import numpy as np

from isc_core.prior_fitting.silhouette import BINS, SilhouetteMoments, fit_silhouette
from isc_core.sirfs.silhouette import normals_cost, normals_from_silhouette


def ball(radius: float, size: int) -> tuple[np.ndarray, np.ndarray]:
    i, j = np.mgrid[:size, :size] - (size - 1) / 2
    mask = i**2 + j**2 < radius**2
    return np.where(mask, np.sqrt(np.maximum(radius**2 - i**2 - j**2, 0)), np.nan), mask


def test_a_balls_profile_is_one_minus_its_depth() -> None:
    profile = fit_silhouette([SilhouetteMoments.of(*ball(60, 140))])
    u = (np.arange(BINS) + 0.5) / BINS
    assert np.abs(profile.mean - (1 - u))[1:-1].max() < 0.05
    assert profile.spread.max() < 0.2


def test_objects_of_any_size_have_equal_weights() -> None:
    small, large = SilhouetteMoments.of(*ball(20, 60)), SilhouetteMoments.of(*ball(60, 140))
    assert abs(small.sums[0].sum() - 1) < 1e-12
    both, swapped = fit_silhouette([small, large]), fit_silhouette([large, small])
    assert np.allclose(both.mean, swapped.mean)


def test_the_true_ball_costs_less_than_a_flat_one_and_than_its_inverse() -> None:
    height, mask = ball(40, 100)
    profile = fit_silhouette([SilhouetteMoments.of(height, mask)])
    field = normals_from_silhouette(mask, profile)
    i, j = (np.mgrid[:100, :100] - 49.5) / 40
    down, right = np.where(mask, i, 0), np.where(mask, j, 0)
    costs = [normals_cost(s * down, s * right, mask, field, 1.0)[0] for s in (1.0, 0.0, -1.0)]
    assert costs[0] < costs[1] < costs[2]
