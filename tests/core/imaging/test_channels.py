"""Statistics of channels and 8-bit codes: the bytes of NumPy's own reductions and of the curve."""

import numpy as np
import pytest

from isc_core.imaging.channels import largest, length, smallest, total
from isc_core.imaging.srgb import linear_to_srgb, srgb_codes

BOTH = pytest.mark.parametrize("dtype", [np.float32, np.float64])


@BOTH
def test_statistics_have_the_bytes_of_reductions(dtype: type) -> None:
    rng = np.random.default_rng(0)
    image: np.ndarray = (
        rng.normal(size=(50, 60, 3)) * 10.0 ** rng.uniform(-3, 3, (50, 60, 3))
    ).astype(dtype)
    for found, wanted in (
        (total(image), image.sum(axis=-1)),
        (length(image), np.linalg.norm(image, axis=-1)),
        (smallest(image), image.min(axis=-1)),
        (largest(image), image.max(axis=-1)),
    ):
        assert found.dtype == dtype
        assert np.array_equal(found, wanted)


@BOTH
def test_codes_are_those_of_the_curve(dtype: type) -> None:
    bounds: np.ndarray = np.interp(np.arange(0.5, 255) / 255, *_curve()).astype(dtype)
    near = [bounds]
    for toward in (0, 1):  # the neighbouring numbers of each place where the code changes
        beside = bounds
        for _ in range(8):
            beside = np.nextafter(beside, dtype(toward))
            near.append(beside)
    linear: np.ndarray = np.concatenate([*near, np.linspace(-0.2, 1.2, 100_003), [0, 1]]).astype(
        dtype
    )
    wanted = np.rint(255 * linear_to_srgb(np.clip(linear, 0, 1)))
    assert np.array_equal(srgb_codes(linear), wanted)


def _curve() -> tuple[np.ndarray, np.ndarray]:
    linear = np.linspace(0, 1, 2_000_001)
    return linear_to_srgb(linear), linear
