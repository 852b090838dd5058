"""What the detail network's answer must not depend on, with random weights, and its bands."""

from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.errors import InputError
from isc_core.imaging.blocks import block_means
from isc_core.networks.detail_network import (
    BLOCK,
    INPUTS,
    MULTIPLE,
    DetailNetwork,
    band,
    channels_of,
    predict_relief,
    raised,
    raised_at,
)
from tests.core.networks.random_convolutions import random_convolutions

DOWN, UP = (5, 6, 7), (6, 5)
SIDE = 8 * MULTIPLE


def weights(seed: int = 0) -> dict[str, np.ndarray]:
    """Random content of an archive."""
    ends = BLOCK**2 * INPUTS, BLOCK**2
    return random_convolutions(np.random.default_rng(seed), ends, DOWN, UP)


def network(folder: Path, **changes: np.ndarray | None) -> DetailNetwork:
    """Random weights, by way of a file."""
    path = folder / "network.npz"
    np.savez(path, **{k: v for k, v in (weights() | changes).items() if v is not None})
    return DetailNetwork.read(path)


def scene(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """An image, mask, slopes, gains and a belief."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE / 2
    mask = np.hypot(x, y) < 0.4 * SIDE
    return (
        rng.uniform(0.1, 2, (SIDE, SIDE, 3)).astype(np.float32),
        mask,
        rng.normal(0, 0.3, (SIDE, SIDE, 2)),
        rng.normal(0, 0.3, (SIDE, SIDE, 2)),
        0.5,
    )


def test_a_band_holds_nothing_of_a_plane_and_all_of_a_checkerboard() -> None:
    y, x = np.mgrid[:32, :32].astype(float)
    inside = (slice(2, -2), slice(2, -2))
    assert np.abs(band(3 * x - 2 * y)[inside]).max() < 1e-12
    checks = (-1.0) ** (x + y)
    assert np.allclose(band(checks), checks)


def test_bands_and_the_coarsest_level_give_the_height_back() -> None:
    height = np.random.default_rng(0).normal(size=(64, 32))
    level, bands = height, []
    for _ in range(3):
        bands.append(band(level))
        level = block_means(level, 2)
    for one in bands[::-1]:
        level = raised(level) + one
    assert np.allclose(level, height, atol=1e-12)


def test_relief_is_inside_the_mask_and_ignores_the_outside(tmp_path: Path) -> None:
    image, mask, slope, gain, belief = scene()
    net = network(tmp_path)
    relief = predict_relief(image, mask, slope, gain, belief, net)
    assert relief.shape == mask.shape and relief[mask].std() > 0 and not relief[~mask].any()
    other = np.where(mask[..., None], image, 7.0)
    assert np.array_equal(relief, predict_relief(other, mask, slope, gain, belief, net))


def test_the_answer_has_the_same_bytes_on_any_number_of_threads(tmp_path: Path) -> None:
    net, given = network(tmp_path), scene()
    with threadpool_limits(1):
        one = predict_relief(*given, net)
    with threadpool_limits(4):
        assert np.array_equal(one, predict_relief(*given, net))


def test_the_level_of_brightness_is_not_relief(tmp_path: Path) -> None:
    image, *known = scene()
    flat, double = (channels_of(np.full_like(image, v), *known) for v in (0.5, 1.0))
    for channel in (0, 1, 2, 9, 10):  # changes of light, and the slopes that explain them
        assert np.abs(flat[..., channel]).max() < 1e-6
        assert np.abs(double[..., channel]).max() < 1e-6


@pytest.mark.parametrize(
    "change",
    [
        {"weight01": None},
        {"bias10": np.zeros(3, np.float16)},
        {"weight00": np.zeros((9, 3, 5), np.float16)},
        {"bias00": np.full(5, np.nan, np.float16)},
    ],
)
def test_weights_of_another_network_are_refused(
    tmp_path: Path, change: dict[str, np.ndarray | None]
) -> None:
    with pytest.raises(InputError, match="detail network"):
        network(tmp_path, **change)


def test_the_shipped_network_finds_bumps_and_keeps_print() -> None:
    """Bumps under a lamp from the left, against a mosaic of as much contrast."""
    side = 128
    y, x = np.mgrid[:side, :side].astype(float)
    mask = np.ones((side, side), bool)
    slope = np.zeros((side, side, 2))
    gain = np.tile([-0.8, 0.0], (side, side, 1))  # a surface that rises to the right is darker
    bumps = 0.25 * np.sin(2 * np.pi * x / 5 + 0.4 * np.sin(y / 9))
    truth = band(bumps)
    shading = np.exp(np.einsum("hwc,hwc->hw", gain, _slopes(bumps)))
    found = predict_relief(np.tile(shading[..., None], 3), mask, slope, gain, 1.0)
    inner = (slice(8, -8), slice(8, -8))
    error, energy = (np.square(_slopes(v))[inner].sum() for v in (found - truth, truth))
    assert error < 0.6 * energy
    tiles = np.random.default_rng(0).choice([0.8, 1.25], (side // 8, side // 8, 3))
    printed = predict_relief(tiles.repeat(8, axis=0).repeat(8, axis=1), mask, slope, gain, -1.0)
    assert np.square(_slopes(printed))[inner].sum() < 0.1 * energy


def _slopes(height: np.ndarray) -> np.ndarray:
    down, right = np.gradient(height)
    return np.stack([right, down], axis=2)


def test_a_part_of_a_raised_map_is_that_of_the_whole() -> None:
    values = np.random.default_rng(0).normal(size=(9, 12, 2)).astype(np.float32)
    whole = raised(values)
    for rows, columns in ((slice(0, 18), slice(0, 24)), (slice(4, 6), slice(10, 24))):
        assert np.array_equal(raised_at(values, (rows, columns)), whole[rows, columns])
