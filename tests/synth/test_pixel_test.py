"""The test of images: correct ones pass at the stated rate, wrong ones fail, and their maps are
written.
"""

from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.io.exr import read_channels
from synth.validation.checks.pixel_test import (
    PixelTestOptions,
    PixelTestResult,
    keep_evidence,
    pixel_test,
    pooled,
)


def noisy(
    rng: np.random.Generator, shape: tuple[int, ...], samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """The mean of samples around 0 whose spread varies from pixel to pixel, and its estimated
    variance.
    """
    sigma = np.exp(rng.normal(size=shape))
    drawn = rng.normal(size=(samples, *shape)) * sigma
    return drawn.mean(0), drawn.var(0, ddof=1) / samples


def verdict(difference: np.ndarray, variance: np.ndarray, **options: float) -> PixelTestResult:
    return pixel_test(difference, variance, PixelTestOptions(**options))


@pytest.mark.slow
@pytest.mark.parametrize("samples", [4, 64])
def test_right_images_are_rejected_no_more_often_than_stated(samples: int) -> None:
    rng = np.random.default_rng(1)
    results = [
        verdict(*noisy(rng, (24, 24), samples), level=0.1, samples=samples) for _ in range(400)
    ]
    rejected = np.mean([not result.accepted for result in results])
    # 400 coins of .1 show .1 +- .045 (3 sigma); the pixels' own part of the level, one half, is
    # exact, which needs a lower bound too.
    assert rejected < 0.145
    assert 0.05 - 0.033 < np.mean([result.beyond > 0 for result in results]) < 0.05 + 0.033
    assert (
        np.mean([abs(result.bias) > result.global_threshold for result in results]) < 0.025 + 0.025
    )


def test_a_normal_law_in_place_of_students_rejects_right_images() -> None:
    rng = np.random.default_rng(2)
    rejected = [not verdict(*noisy(rng, (24, 24), 4), level=0.1).accepted for _ in range(20)]
    assert all(rejected)


def test_z_of_pixels_is_normal_for_any_number_of_samples() -> None:
    difference, variance = noisy(np.random.default_rng(3), (200, 200), 5)
    z = verdict(difference, variance, samples=5).z
    np.testing.assert_allclose(
        [z.mean(), z.std(), (np.abs(z) > 1.96).mean()], [0, 1, 0.05], atol=0.02
    )


@pytest.mark.parametrize("share", [0.05, -0.05])
def test_a_bias_far_below_the_noise_is_found(share: float) -> None:
    rng = np.random.default_rng(4)
    sigma = 1 + rng.random((128, 128))
    result = verdict(rng.normal(size=sigma.shape) * sigma + share * sigma, sigma**2)
    assert not result.accepted
    assert result.beyond == 0
    assert np.sign(result.bias) == np.sign(share)


def test_a_bias_of_one_channel_is_found() -> None:
    rng = np.random.default_rng(5)
    difference = rng.normal(size=(128, 128, 3))
    assert verdict(difference, np.ones_like(difference)).accepted
    difference[..., 2] += 0.05
    assert not verdict(difference, np.ones_like(difference)).accepted


def test_one_wrong_pixel_is_found_and_named() -> None:
    rng = np.random.default_rng(6)
    difference, variance = noisy(rng, (64, 64), 64)
    assert verdict(difference, variance, samples=64).accepted
    difference[10, 20] = 8 * np.sqrt(variance[10, 20])
    result = verdict(difference, variance, samples=64)
    assert not result.accepted
    assert result.beyond == 1
    assert result.where == (10, 20)
    assert "(10, 20)" in result.text()


def test_a_variance_that_claims_too_little_is_found() -> None:
    rng = np.random.default_rng(7)
    difference = rng.normal(size=(64, 64))
    result = verdict(difference, np.full((64, 64), 0.8))
    assert not result.accepted
    assert result.spread > result.global_threshold


def test_without_noise_only_the_tolerance_counts() -> None:
    difference, variance = np.zeros((8, 8)), np.zeros((8, 8))
    difference[3, 4] = 1e-6
    assert verdict(difference, variance, tolerance=2e-6).accepted
    result = verdict(difference, variance, tolerance=1e-7)
    assert not result.accepted
    assert result.worst == np.inf
    assert result.where == (3, 4)


def test_pooling_keeps_means_and_their_variance() -> None:
    rng = np.random.default_rng(8)
    drawn = rng.normal(size=(2000, 6, 6)) * (1 + np.arange(6))
    means = np.array([pooled(image, 3) for image in drawn])
    known = pooled(np.broadcast_to((1.0 + np.arange(6)) ** 2, (6, 6)), 3, variance=True)
    np.testing.assert_allclose(means.var(0), known, rtol=0.15)
    assert pooled(np.ones((7, 8, 3)), 3).shape == (2, 2, 3)


def test_evidence_is_kept_of_rejections_only(tmp_path: Path) -> None:
    variance = np.ones((8, 8, 3))
    difference = np.zeros((8, 8, 3))
    assert (
        keep_evidence(tmp_path / "why", difference, variance, verdict(difference, variance)) is None
    )
    assert not (tmp_path / "why").exists()
    difference[1, 2, 0], variance[4, 4] = 50, 0
    difference[4, 4, 1] = 1e-3  # infinite z
    for _ in range(2):  # a second time replaces the first
        path = keep_evidence(tmp_path / "why", difference, variance, verdict(difference, variance))
    assert path is not None
    channels = read_channels(path)
    assert set(channels) == {
        f"{name}.{letter}" for name in ("difference", "variance", "z") for letter in "RGB"
    }
    assert channels["z.R"][1, 2] == pytest.approx(50)
    assert channels["z.G"][4, 4] > 1e29
    assert all(np.isfinite(plane).all() for plane in channels.values())
    (tmp_path / "why" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="notes.txt"):
        keep_evidence(tmp_path / "why", difference, variance, verdict(difference, variance))


@pytest.mark.parametrize(
    ("difference", "variance"),
    [
        (np.zeros((4, 4)), np.zeros((4, 5))),
        (np.zeros(4), np.zeros(4)),
        (np.full((4, 4), np.nan), np.ones((4, 4))),
        (np.zeros((4, 4)), -np.ones((4, 4))),
        (np.zeros((0, 4)), np.zeros((0, 4))),
    ],
)
def test_images_that_cannot_be_tested_are_refused(
    difference: np.ndarray, variance: np.ndarray
) -> None:
    with pytest.raises(InputError):
        pixel_test(difference, variance)


def test_options_that_make_no_sense_are_refused() -> None:
    for options in ({"level": 0}, {"level": 1}, {"tolerance": -1}, {"samples": 1}):
        with pytest.raises(InputError):
            PixelTestOptions(**options)
    with pytest.raises(InputError):
        pooled(np.ones((4, 4)), 5)
