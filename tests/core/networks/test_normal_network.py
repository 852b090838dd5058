"""How a photo's shape looks: what the network's answer must not depend on, and what the shipped
weights can do.
"""

from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.errors import InputError
from isc_core.networks.normal_network import NormalNetwork, predict_normals
from tests.core.lit_balls import ball, under_lights

SHAPES = [
    (16, 4),
    (4, 4),
    (4, 6),
    (6, 6),
    (6, 8),
    (8, 8),
    (14, 6),
    (6, 6),
    (6, 4),
]  # three levels down, one up, the answer


def small_network(rng: np.random.Generator) -> NormalNetwork:
    """Random weights."""
    weights = tuple(
        rng.normal(0, (2 / (9 * inputs)) ** 0.5, (9, inputs, outputs)).astype(np.float32)
        for inputs, outputs in SHAPES
    )
    return NormalNetwork(
        weights, tuple(rng.normal(0, 0.1, outputs).astype(np.float32) for _, outputs in SHAPES)
    )


def photo(
    rng: np.random.Generator, rows: int = 70, columns: int = 50
) -> tuple[np.ndarray, np.ndarray]:
    mask = np.zeros((rows, columns), bool)
    mask[5:-10, 8:-8] = True
    mask[6:-11, 9:-9] = rng.random((rows - 17, columns - 18)) < 0.9
    return rng.uniform(0.01, 1, (rows, columns, 3)).astype(np.float32), mask


@pytest.mark.parametrize("size", [(70, 50), (300, 240)])
def test_normals_and_deviations_are_of_the_object(size: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    network, (image, mask) = small_network(rng), photo(rng, *size)
    seen = predict_normals(image, mask, network)
    assert seen.normal.shape == (*size, 3) and seen.deviation.shape == size
    assert (
        (seen.deviation[mask] > 0).all()
        and not seen.deviation[~mask].any()
        and not seen.normal[~mask].any()
    )
    bright = predict_normals(8 * image, mask, network)
    np.testing.assert_allclose(bright.normal, seen.normal, atol=1e-4)
    np.testing.assert_allclose(bright.deviation, seen.deviation, rtol=1e-4)


def test_the_photo_mirrored_has_its_shape_mirrored() -> None:
    rng = np.random.default_rng(1)
    network, (image, mask) = small_network(rng), photo(rng)
    seen, mirrored = (
        predict_normals(image, mask, network),
        predict_normals(image[:, ::-1], mask[:, ::-1], network),
    )
    np.testing.assert_allclose(mirrored.normal[:, ::-1] * (-1, 1, 1), seen.normal, atol=1e-5)
    np.testing.assert_allclose(mirrored.deviation[:, ::-1], seen.deviation, rtol=1e-5)


def test_what_is_outside_the_mask_and_the_number_of_threads_change_nothing() -> None:
    rng = np.random.default_rng(2)
    network, (image, mask) = small_network(rng), photo(rng)
    seen = predict_normals(image, mask, network)
    padded = np.pad(
        np.where(mask[..., None], image, 7), ((13, 4), (3, 21), (0, 0)), constant_values=9
    )
    for threads in (1, 3):
        with threadpool_limits(threads):
            again = predict_normals(padded, np.pad(mask, ((13, 4), (3, 21))), network)
        np.testing.assert_array_equal(again.normal[13:-4, 3:-21], seen.normal)
        np.testing.assert_array_equal(again.deviation[13:-4, 3:-21], seen.deviation)


@pytest.mark.parametrize("level", [0.0, 1e-30, 1.0])
def test_photos_without_anything_in_them_have_a_shape_too(level: float) -> None:
    seen = predict_normals(np.full((9, 9, 3), level, np.float32), np.eye(9, dtype=bool))
    assert np.isfinite(seen.normal).all() and np.isfinite(seen.deviation).all()


@pytest.mark.parametrize(
    "lamps",
    [[(-0.5, 0.5, 0.7)], [(0.6, 0.1, 0.7)], [(0.1, 0.8, 0.6)], [(-0.7, 0.2, 0.6), (0.7, 0.4, 0.6)]],
)
def test_a_painted_ball_is_round(lamps: list[tuple[float, float, float]]) -> None:
    seen, (normal, mask) = predict_normals(*under_lights(*lamps)), ball()
    length = np.linalg.norm(seen.normal, axis=-1)
    cosine = (seen.normal * normal).sum(-1)[mask] / length[mask]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 12
    off = np.square((seen.normal - normal)[..., :2]).sum(-1)[mask] / (2 * seen.deviation[mask] ** 2)
    assert off.mean() < 2  # as far off as it says


def test_files_that_hold_no_network_are_refused(tmp_path: Path) -> None:
    bad = tmp_path / "bad.npz"
    bad.write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"bad\.npz is not a normal network"):
        NormalNetwork.read(bad)
    network = small_network(np.random.default_rng(3))
    parts = {f"weight{k:02d}": values for k, values in enumerate(network.weights)}
    parts |= {f"bias{k:02d}": values for k, values in enumerate(network.biases)}
    for wrong in (
        {"weight06": np.ones((9, 8, 6))},
        {"bias08": np.ones(3)},
        {"weight09": np.ones((9, 4, 4)), "bias09": np.ones(4)},
    ):
        np.savez(bad, **(parts | wrong))
        with pytest.raises(InputError, match="not the weights of a normal network"):
            NormalNetwork.read(bad)
    np.savez(bad, **(parts | {"bias03": np.full(6, np.nan)}))
    with pytest.raises(InputError, match="not finite"):
        NormalNetwork.read(bad)
    np.savez(bad, **parts)
    assert len(NormalNetwork.read(bad).weights) == 9
