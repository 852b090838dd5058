"""The cameras of the measured sets: how noisy their photos are."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from benchmarks.detail.cameras import Camera, photo_of  # noqa: E402

SIDE = 64
MASK = np.ones((SIDE, SIDE), bool)


def taken(camera: Camera, light: np.ndarray, seed: int = 0) -> tuple[np.ndarray, dict[str, float]]:
    return photo_of(light.astype(np.float32), MASK, camera, np.random.default_rng(seed))


def test_a_phone_is_noisier_and_the_same_seed_gives_the_same_photo() -> None:
    light = np.full((SIDE, SIDE, 3), 0.4)
    light[0] = 2.0  # the exposure leaves the rest at a fifth of it
    deviation = {
        camera: np.mean([taken(camera, light, seed)[0][8:].std(axis=(0, 1)) for seed in range(4)])
        for camera in Camera
    }
    assert deviation[Camera.PHONE] > 2 * deviation[Camera.GOOD] > 0
    first, again = (taken(Camera.PHONE, light)[0] for _ in range(2))
    assert np.array_equal(first, again)


def test_relative_noise_of_a_phone_is_larger_in_the_dark() -> None:
    light = np.ones((SIDE, SIDE, 3))
    light[:, : SIDE // 2] = 0.05
    codes, facts = taken(Camera.PHONE, light)
    linear = (codes / 255.0) ** 2.2
    dark, bright = linear[8:-8, 8 : SIDE // 2 - 8], linear[8:-8, SIDE // 2 + 8 : -8]
    assert dark.std() / dark.mean() > 1.5 * bright.std() / bright.mean()
    assert 0.008 <= facts["photons"] <= 0.04 and 75 <= facts["quality"] <= 95
