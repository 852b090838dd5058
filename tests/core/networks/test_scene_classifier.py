"""What a photo seems to show: what the network's answer must not depend on, and what the shipped
weights can do.
"""

from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.errors import InputError
from isc_core.networks.scene_classifier import (
    GLASS,
    KINDS,
    LAMPS,
    MIRROR,
    ORDINARY,
    SceneClassifier,
    classify_scene,
)
from tests.core.lit_balls import mirror_ball, under_lights
from training.data.environments import ENVIRONMENTS, make_environment

SHAPES = [(16, 4), (4, 4), (4, 6), (6, 6)]


def small_network(rng: np.random.Generator) -> SceneClassifier:
    """Two levels, random weights."""
    weights = tuple(
        rng.normal(0, (2 / (9 * inputs)) ** 0.5, (9, inputs, outputs)).astype(np.float32)
        for inputs, outputs in SHAPES
    )
    biases = tuple(rng.normal(0, 0.1, outputs).astype(np.float32) for _, outputs in SHAPES)
    return SceneClassifier(
        weights,
        biases,
        rng.normal(size=30),
        rng.uniform(1, 2, 30),
        rng.normal(size=(30, 4)),
        rng.normal(size=4),
    )


def photo(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    mask = np.zeros((70, 50), bool)
    mask[5:60, 8:42] = True
    mask[6:59, 9:41] = rng.random((53, 32)) < 0.9
    return rng.uniform(0.01, 1, (70, 50, 3)).astype(np.float32), mask


def shares(kinds: dict[str, float]) -> np.ndarray:
    return np.array([kinds[name] for name in KINDS])


def test_the_answer_is_one_of_probabilities_whatever_the_exposure_and_the_side() -> None:
    rng = np.random.default_rng(0)
    network, (image, mask) = small_network(rng), photo(rng)
    found = shares(classify_scene(image, mask, network))
    assert found.min() > 0 and found.sum() == pytest.approx(1)
    np.testing.assert_allclose(shares(classify_scene(8 * image, mask, network)), found, rtol=1e-4)
    np.testing.assert_allclose(
        shares(classify_scene(image[:, ::-1], mask[:, ::-1], network)), found, rtol=1e-9
    )


def test_what_is_outside_the_mask_and_the_number_of_threads_change_nothing() -> None:
    rng = np.random.default_rng(1)
    network, (image, mask) = small_network(rng), photo(rng)
    found = shares(classify_scene(image, mask, network))
    padded = np.pad(
        np.where(mask[..., None], image, 7), ((13, 4), (3, 21), (0, 0)), constant_values=9
    )
    for threads in (1, 3):
        with threadpool_limits(threads):
            np.testing.assert_array_equal(
                shares(classify_scene(padded, np.pad(mask, ((13, 4), (3, 21))), network)), found
            )


@pytest.mark.parametrize("level", [0.0, 1e-30, 1.0])
def test_photos_without_anything_in_them_are_judged_too(level: float) -> None:
    found = shares(classify_scene(np.full((9, 9, 3), level, np.float32), np.eye(9, dtype=bool)))
    assert np.isfinite(found).all() and found.sum() == pytest.approx(1)


@pytest.mark.slow
@pytest.mark.parametrize("place", ENVIRONMENTS)
def test_mirrors_look_like_mirrors(place: str) -> None:
    found = [
        classify_scene(*mirror_ball(make_environment(place, np.random.default_rng([9, k]))))
        for k in range(10)
    ]
    assert sum(kinds[MIRROR] + kinds[GLASS] > 0.5 for kinds in found) >= (
        6 if place == "clutter" else 8
    )


def test_paint_under_one_lamp_is_ordinary_and_under_three_it_is_not() -> None:
    assert classify_scene(*under_lights((-0.5, 0.5, 0.7)))[ORDINARY] > 0.7
    assert (
        classify_scene(*under_lights((-0.8, 0.4, 0.7), (0.8, 0.3, 0.7), (0.1, -0.8, 0.7)))[LAMPS]
        > 0.8
    )


def test_files_that_hold_no_network_are_refused(tmp_path: Path) -> None:
    bad = tmp_path / "bad.npz"
    bad.write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"bad\.npz is not a scene classifier"):
        SceneClassifier.read(bad)
    network = small_network(np.random.default_rng(2))
    parts = {f"weight{k:02d}": values for k, values in enumerate(network.weights)}
    parts |= {f"bias{k:02d}": values for k, values in enumerate(network.biases)}
    parts |= {name: getattr(network, name) for name in ("middle", "scale", "head", "odds")}
    for wrong in (
        {"head": network.head[:9]},
        {"scale": 0 * network.scale},
        {"bias01": np.ones(3)},
        {"weight00": np.ones((9, 3, 4))},
    ):
        np.savez(bad, **(parts | wrong))
        with pytest.raises(InputError, match="not the weights"):
            SceneClassifier.read(bad)
    np.savez(bad, **{name: values for name, values in parts.items() if name != "odds"})
    with pytest.raises(InputError, match="odds"):
        SceneClassifier.read(bad)
    np.savez(bad, **parts)
    assert len(SceneClassifier.read(bad).weights) == 4
