"""With many objects, the bootstrap interval of a mean is that of the normal distribution."""

import numpy as np
import pytest

from benchmarks.bootstrap import bootstrap_samples, cluster_samples, interval


def test_the_interval_of_a_mean_is_two_standard_errors_wide_on_each_side() -> None:
    values = np.random.default_rng(3).normal([1, -4], [2, 0.5], (400, 2))
    low, high = interval(bootstrap_samples(values).mean(axis=1))
    mean, error = values.mean(axis=0), values.std(axis=0) / 400**0.5
    assert (mean - low) / error == pytest.approx(1.96, rel=0.1)
    assert (high - mean) / error == pytest.approx(1.96, rel=0.1)


def test_rows_stay_together() -> None:
    values = np.random.default_rng(4).uniform(1, 2, 30)
    samples = bootstrap_samples(np.stack([values, 3 * values], axis=1), count=50)
    assert samples.shape == (50, 30, 2)
    assert samples[..., 1] == pytest.approx(3 * samples[..., 0])


def test_photos_of_one_scene_count_once() -> None:
    """Four equal photos of each scene tell no more than one: the interval is not half as wide."""
    values = np.random.default_rng(5).normal(size=100)
    alone = interval(bootstrap_samples(values).mean(axis=1))
    scenes = np.repeat(np.arange(100), 4).tolist()
    repeated = list(cluster_samples(np.repeat(values, 4), scenes))
    together = interval(np.array([drawn.mean() for drawn in repeated]))
    assert np.subtract(*together) == pytest.approx(np.subtract(*alone), rel=0.02)
    for drawn in repeated[:20]:
        assert all(np.ptp(photos) == 0 for photos in drawn.reshape(-1, 4)), "scenes stay whole"
