"""What the mask network's answer must not depend on, with random weights."""

from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.errors import InputError
from isc_core.networks.encoder_decoder import BLOCK
from isc_core.networks.mask_network import (
    COARSE,
    INPUTS,
    SIDE,
    Count,
    MaskNetwork,
    predict_mask,
)
from tests.core.networks.random_convolutions import random_convolutions

DOWN, UP, HIDDEN = (4, 6, 8, 6), (7, 5, 4), 9


def weights(seed: int) -> dict[str, np.ndarray]:
    """Random content of an archive."""
    rng = np.random.default_rng(seed)
    arrays = random_convolutions(rng, (BLOCK**2 * INPUTS, BLOCK**2), DOWN, UP)
    features = 2 * sum(DOWN[-COARSE:])
    for name, rows, columns in (("hidden", features, HIDDEN), ("count", HIDDEN, len(Count))):
        arrays[f"{name}_weight"] = rng.normal(0, rows**-0.5, (rows, columns)).astype(np.float16)
        arrays[f"{name}_bias"] = rng.normal(0, 0.1, columns).astype(np.float16)
    return {**arrays, "sureness": np.array([0, 1, 0.5, 1, 0.5, 0.5], np.float32)}


def network(folder: Path, **changes: np.ndarray | None) -> MaskNetwork:
    """Random weights, by way of a file."""
    path = folder / "network.npz"
    kept = {name: part for name, part in (weights(0) | changes).items() if part is not None}
    np.savez(path, **kept)
    return MaskNetwork.read(path)


def inputs(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    frame = np.zeros((SIDE, SIDE), bool)
    frame[10:-10] = True
    light = rng.uniform(0, 1, (SIDE, SIDE, 3)).astype(np.float32) * frame[..., None]
    return light, frame, (rng.random((SIDE, SIDE, 3)) < 0.01).astype(np.float32)


def test_the_mirrored_photo_has_the_mirrored_mask_to_the_last_bit(tmp_path: Path) -> None:
    one, (light, frame, hints) = network(tmp_path), inputs()
    seen = predict_mask(light, frame, hints, one)
    mirrored = predict_mask(light[:, ::-1], frame[:, ::-1], hints[:, ::-1], one)
    assert np.array_equal(mirrored.cover[:, ::-1], seen.cover)
    assert np.array_equal(mirrored.counts, seen.counts)
    assert seen.counts.sum() == pytest.approx(1) and not seen.cover[~frame].any()
    assert np.ptp(seen.cover[frame]) > 0.1, "random weights say something"


def test_the_exposure_does_not_matter_and_hints_do(tmp_path: Path) -> None:
    one, (light, frame, hints) = network(tmp_path), inputs()
    seen = predict_mask(light, frame, hints, one)
    brighter = predict_mask(4 * light, frame, hints, one)
    np.testing.assert_allclose(brighter.cover, seen.cover, atol=1e-4)
    without = predict_mask(light, frame, 0 * hints, one)
    assert np.abs(without.cover - seen.cover).max() > 1e-3


def test_the_mask_is_the_same_on_any_number_of_threads(tmp_path: Path) -> None:
    one, given = network(tmp_path), inputs()
    with threadpool_limits(1):
        alone = predict_mask(*given, one)
    with threadpool_limits(4):
        together = predict_mask(*given, one)
    assert alone.cover.tobytes() == together.cover.tobytes()
    assert alone.counts.tobytes() == together.counts.tobytes()


@pytest.mark.parametrize(
    "changes",
    [
        {"weight03": None},
        {"weight02": np.zeros((9, 4, 7), np.float16)},
        {"bias01": np.zeros(3, np.float16)},
        {"count_bias": np.zeros(4, np.float16)},
        {"sureness": np.zeros(3, np.float32)},
        {"sureness": None},
        {"bias00": np.full(4, np.nan, np.float16)},
    ],
)
def test_weights_that_do_not_fit_are_refused(
    tmp_path: Path, changes: dict[str, np.ndarray | None]
) -> None:
    with pytest.raises(InputError, match="mask network"):
        network(tmp_path, **changes)


def test_a_truncated_archive_is_refused(tmp_path: Path) -> None:
    network(tmp_path)
    path = tmp_path / "network.npz"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError):
        MaskNetwork.read(path)


def test_the_shipped_network_is_small() -> None:
    one = MaskNetwork.shipped()
    count = sum(part.size for part in (*one.weights, *one.biases, *one.dense, *one.offsets))
    assert count <= 2_000_000
