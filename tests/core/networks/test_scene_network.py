"""What the scene network's answer must not depend on, with random weights."""

from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.errors import InputError
from isc_core.io.stage_cache import StageCache
from isc_core.networks.encoder_decoder import BLOCK
from isc_core.networks.scene_network import (
    CHANNELS,
    COARSE,
    GLOBAL,
    INPUTS,
    SceneNetwork,
    ScenePrediction,
    predict_layers,
    predict_scene,
)
from isc_core.scene.light_estimate import mirrored_places
from tests.core.networks.random_convolutions import random_convolutions

WIDTHS = (4, 6, 6, 8)
HIDDEN = 10
FLIPPED = np.array([1, 1, 1, -1, -1, 1, 1, -1, 1.0])[:, None]  # harmonics odd in x


def weights(seed: int) -> dict[str, np.ndarray]:
    """Random content of an archive."""
    rng = np.random.default_rng(seed)
    ends = BLOCK**2 * INPUTS, BLOCK**2 * CHANNELS
    arrays = random_convolutions(rng, ends, WIDTHS, WIDTHS[-2::-1])
    features = 2 * sum(WIDTHS[-COARSE:])
    for name, (inputs, outputs) in {
        "hidden": (features, HIDDEN),
        "light": (HIDDEN, GLOBAL),
    }.items():
        arrays[f"{name}_weight"] = rng.normal(0, inputs**-0.5, (inputs, outputs)).astype(np.float16)
        arrays[f"{name}_bias"] = rng.normal(0, 0.1, outputs).astype(np.float16)
    arrays["temperatures"] = np.array([1.0, 1.5, 0.8, 1.2], np.float32)
    arrays["normalisation"] = np.zeros((4, 3), np.float32)
    return arrays


def small_network(folder: Path, seed: int = 0, **changes: np.ndarray | None) -> SceneNetwork:
    """Random weights, by way of a file."""
    path, parts = folder / "network.npz", weights(seed) | changes
    kept = {name: values for name, values in parts.items() if values is not None}
    np.savez(path, **kept)
    return SceneNetwork.read(path)


def photo(
    rng: np.random.Generator, rows: int = 70, columns: int = 50
) -> tuple[np.ndarray, np.ndarray]:
    mask = np.zeros((rows, columns), bool)
    mask[5:-10, 8:-8] = True
    mask[6:-11, 9:-9] = rng.random((rows - 17, columns - 18)) < 0.9
    return rng.uniform(0.01, 1, (rows, columns, 3)).astype(np.float32), mask


def maps_of(seen: ScenePrediction) -> dict[str, np.ndarray]:
    return {
        "normal": seen.normals.normal,
        "deviation": seen.normals.deviation,
        "ratio": seen.log_ratio,
        "ratio_scale": seen.ratio_scale,
        "shading": seen.shading.log_shading,
        "shading_deviation": seen.shading.deviation,
        "edge": seen.edge,
    }


def numbers_of(seen: ScenePrediction) -> dict[str, np.ndarray]:
    return {
        "mean": seen.light.mean,
        "covariance": seen.light.covariance,
        "counts": seen.counts,
        "places": seen.places,
        "kinds": seen.kinds,
    }


@pytest.mark.parametrize("size", [(70, 50), (300, 240)])
def test_the_answer_is_of_the_object(tmp_path: Path, size: tuple[int, int]) -> None:
    network, (image, mask) = small_network(tmp_path), photo(np.random.default_rng(0), *size)
    seen = predict_scene(image, mask, network)
    for name, values in maps_of(seen).items():
        assert values.shape[:2] == size and np.isfinite(values).all(), name
        assert not values[~mask].any(), name
    for name in ("deviation", "ratio_scale", "shading_deviation"):
        assert (maps_of(seen)[name][mask] > 0).all()
    assert (seen.log_ratio >= 0).all() and (seen.edge <= 1).all()
    for shares in (seen.counts, seen.places, seen.kinds):
        assert shares.sum() == pytest.approx(1) and (shares >= 0).all()
    np.testing.assert_allclose(seen.light.covariance, seen.light.covariance.T, rtol=1e-12)
    assert np.linalg.eigvalsh(seen.light.covariance).min() > 0


def test_the_exposure_changes_nothing(tmp_path: Path) -> None:
    """What is said is of a photo of mean light 1: shading and light are relative to it."""
    network, (image, mask) = small_network(tmp_path), photo(np.random.default_rng(1))
    seen, bright = (predict_scene(gain * image, mask, network) for gain in (1, 7))
    for get in (maps_of, numbers_of):
        for name, values in get(seen).items():
            np.testing.assert_allclose(get(bright)[name], values, rtol=1e-3, atol=1e-4)


def test_the_photo_mirrored_has_its_scene_mirrored(tmp_path: Path) -> None:
    network, (image, mask) = small_network(tmp_path), photo(np.random.default_rng(2))
    seen = predict_scene(image, mask, network)
    mirrored = predict_scene(image[:, ::-1], mask[:, ::-1], network)
    for name, values in maps_of(mirrored).items():
        wanted = values[:, ::-1] * (-1, 1, 1) if name == "normal" else values[:, ::-1]
        np.testing.assert_allclose(wanted, maps_of(seen)[name], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(mirrored.light.mean * FLIPPED, seen.light.mean, atol=1e-6)
    signs = np.tile(FLIPPED[:, 0], 3)
    np.testing.assert_allclose(
        signs[:, None] * mirrored.light.covariance * signs, seen.light.covariance, atol=1e-6
    )
    np.testing.assert_allclose(mirrored.counts, seen.counts, atol=1e-6)
    np.testing.assert_allclose(mirrored.kinds, seen.kinds, atol=1e-6)
    # Mirrored places are others of the list, nearly: most probability moves with them.
    places = mirrored.places[mirrored_places()]
    assert np.abs(places / places.sum() - seen.places).sum() < 0.1


def test_neither_the_background_nor_the_threads_change_a_bit(tmp_path: Path) -> None:
    network, (image, mask) = small_network(tmp_path), photo(np.random.default_rng(3))
    seen = predict_scene(image, mask, network)
    padded = np.pad(
        np.where(mask[..., None], image, 7), ((13, 4), (3, 21), (0, 0)), constant_values=9
    )
    for threads in (1, 2):
        with threadpool_limits(threads):
            again = predict_scene(padded, np.pad(mask, ((13, 4), (3, 21))), network)
        for name, values in maps_of(again).items():
            np.testing.assert_array_equal(values[13:-4, 3:-21], maps_of(seen)[name])
        for name, values in numbers_of(again).items():
            np.testing.assert_array_equal(values, numbers_of(seen)[name])


def test_a_kept_answer_is_that_of_the_photo_and_of_the_network(tmp_path: Path) -> None:
    network, (image, mask) = small_network(tmp_path), photo(np.random.default_rng(6))
    other = small_network(tmp_path, temperatures=np.array([1.0, 1, 1, 2]))
    kept = StageCache(tmp_path / "kept")

    def same(one: ScenePrediction, two: ScenePrediction) -> bool:
        first, second = (maps_of(seen) | numbers_of(seen) for seen in (one, two))
        return all(np.array_equal(first[name], second[name]) for name in first)

    wanted = predict_scene(image, mask, network)
    for _ in range(2):
        assert same(predict_scene(image, mask, network, kept), wanted)
        layers = predict_layers(image, mask, network, kept)
        assert np.array_equal(layers.log_ratio, wanted.log_ratio)
        assert len(list(kept.folder.iterdir())) == 1
    assert same(predict_scene(image, mask, other, kept), predict_scene(image, mask, other))
    assert not same(predict_scene(image, mask, other, kept), wanted)
    less = mask.copy()
    less[np.nonzero(mask)[0][0]] = False
    assert same(predict_scene(image, less, network, kept), predict_scene(image, less, network))


@pytest.mark.parametrize("size", [(1, 200), (200, 1), (1, 1), (2, 3), (130, 400)])
def test_any_size_has_an_answer(tmp_path: Path, size: tuple[int, int]) -> None:
    image = np.random.default_rng(4).uniform(0, 1, (*size, 3)).astype(np.float32)
    seen = predict_scene(image, np.ones(size, bool), small_network(tmp_path))
    for values in (maps_of(seen) | numbers_of(seen)).values():
        assert np.isfinite(values).all()
    assert seen.normals.normal.shape == (*size, 3)


@pytest.mark.parametrize("level", [0.0, 1e-30, 1e6])
def test_photos_without_anything_in_them_have_an_answer(tmp_path: Path, level: float) -> None:
    image = np.full((9, 9, 3), level, np.float32)
    seen = predict_scene(image, np.eye(9, dtype=bool), small_network(tmp_path))
    for values in (maps_of(seen) | numbers_of(seen)).values():
        assert np.isfinite(values).all()


def test_temperatures_scale_the_uncertainties(tmp_path: Path) -> None:
    image, mask = photo(np.random.default_rng(5))
    one, two = (
        predict_scene(image, mask, small_network(tmp_path, temperatures=np.array(values)))
        for values in ([1.0, 1, 1, 1], [2.0, 3, 4, 5])
    )
    np.testing.assert_allclose(two.normals.deviation, 2 * one.normals.deviation)
    np.testing.assert_allclose(two.ratio_scale, 3 * one.ratio_scale)
    np.testing.assert_allclose(two.shading.deviation, 4 * one.shading.deviation)
    np.testing.assert_allclose(two.light.covariance, 25 * one.light.covariance)
    np.testing.assert_array_equal(two.normals.normal, one.normals.normal)


@pytest.mark.parametrize(
    "wrong",
    [
        {"weight06": np.ones((9, 8, 6))},
        {"bias03": np.ones(3)},
        {"hidden_weight": np.ones((7, HIDDEN))},
        {"light_bias": np.ones(GLOBAL - 1)},
        {"light_weight": np.ones((HIDDEN, GLOBAL + 3))},
        {"temperatures": np.ones(3)},
        {"temperatures": np.array([1.0, 1, 0, 1])},
        {"weight15": np.ones((9, 4, 4)), "bias15": np.ones(4)},
        {"hidden_weight": np.ones(3)},
        {"hidden_weight": np.array(3.0)},
        {"weight01": np.array(3.0)},
        {"weight14": None, "bias14": None},
    ],
)
def test_weights_of_another_version_are_refused(
    tmp_path: Path, wrong: dict[str, np.ndarray | None]
) -> None:
    with pytest.raises(InputError, match="not the weights of a scene network") as caught:
        small_network(tmp_path, **wrong)
    assert "\n" not in str(caught.value)


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    small_network(tmp_path)
    path = tmp_path / "network.npz"
    whole = path.read_bytes()
    for damaged in (b"", b"no archive", whole[: len(whole) // 2], whole[:-30]):
        path.write_bytes(damaged)
        with pytest.raises(InputError) as caught:
            SceneNetwork.read(path)
        assert "network.npz" in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(InputError, match="hidden_bias"):
        small_network(tmp_path, hidden_bias=None)
    for broken in ({"bias03": np.full(6, np.nan)}, {"light_bias": np.full(GLOBAL, np.inf)}):
        with pytest.raises(InputError, match="not finite"):
            small_network(tmp_path, **broken)
    with pytest.raises(InputError):
        SceneNetwork.read(tmp_path / "absent.npz")
