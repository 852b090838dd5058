"""How a photo's light looks: what the network's answer must not depend on, and what the shipped
weights can do.
"""

from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from isc_core.errors import InputError
from isc_core.networks.light_network import LightNetwork, predict_light
from isc_core.scene.light_estimate import PLACES, LightEstimate
from isc_core.shading.spherical_harmonics import real_sh
from tests.core.lit_balls import SIDE, ball, under_lights

SHAPES = [(16, 4), (4, 4), (4, 6), (6, 6)]
LAYERS = {
    "local": (15, 7),
    "whole": (21, 8),
    "lamps": (8, 3),
    "places": (8, len(PLACES)),
    "light": (8, 16),
}


def small_network(rng: np.random.Generator) -> LightNetwork:
    """Two levels, random weights."""
    weights = tuple(
        rng.normal(0, (2 / (9 * inputs)) ** 0.5, (9, inputs, outputs)).astype(np.float32)
        for inputs, outputs in SHAPES
    )
    biases = tuple(rng.normal(0, 0.1, outputs).astype(np.float32) for _, outputs in SHAPES)
    layers = {
        name: (rng.normal(0, shape[0] ** -0.5, shape), rng.normal(0, 0.1, shape[1]))
        for name, shape in LAYERS.items()
    }
    return LightNetwork(weights, biases, rng.normal(size=10), rng.uniform(0.5, 1, 10), layers)


def photo(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    mask = np.zeros((70, 50), bool)
    mask[5:60, 8:42] = True
    mask[6:59, 9:41] = rng.random((53, 32)) < 0.9
    return rng.uniform(0.01, 1, (70, 50, 3)).astype(np.float32), mask


def off(one: np.ndarray, other: np.ndarray) -> float:
    """Degrees between two directions."""
    return float(
        np.degrees(
            np.arccos(np.clip(one @ other / np.linalg.norm(one) / np.linalg.norm(other), -1, 1))
        )
    )


def numbers(lamps: LightEstimate) -> np.ndarray:
    return np.concatenate(
        [[lamps.none, lamps.one, lamps.several], lamps.places, lamps.light, lamps.deviations]
    )


def test_places_are_unit_vectors_evenly_before_the_object() -> None:
    np.testing.assert_allclose(np.linalg.norm(PLACES, axis=1), 1, rtol=1e-12)
    assert PLACES[:, 2].min() > -0.2
    nearest = np.sort(np.degrees(np.arccos(np.clip(PLACES @ PLACES.T, -1, 1))), axis=1)[:, 1]
    assert nearest.min() > 7 and nearest.max() < 12


def test_the_answer_is_one_of_probabilities_whatever_the_exposure() -> None:
    rng = np.random.default_rng(0)
    network, (image, mask) = small_network(rng), photo(rng)
    found = predict_light(image, mask, network)
    assert found.none + found.one + found.several == pytest.approx(
        1
    ) and found.places.sum() == pytest.approx(1)
    assert min(found.none, found.one, found.several, found.places.min(), found.deviations.min()) > 0
    np.testing.assert_allclose(
        numbers(predict_light(8 * image, mask, network)), numbers(found), rtol=1e-4, atol=1e-6
    )


def test_the_photo_mirrored_has_its_light_mirrored() -> None:
    rng = np.random.default_rng(3)
    network, (image, mask) = small_network(rng), photo(rng)
    found, mirrored = (
        predict_light(image, mask, network),
        predict_light(image[:, ::-1], mask[:, ::-1], network),
    )
    assert (mirrored.none, mirrored.one) == pytest.approx((found.none, found.one))
    normal, _ = ball()
    row = slice(SIDE // 3, SIDE // 3 + 1)
    seen, other = (
        real_sh(normal[row, 20:-20])[..., 1:] @ lamps.light for lamps in (found, mirrored)
    )
    np.testing.assert_allclose(other[:, ::-1], seen, atol=1e-6)
    assert (
        off(mirrored.direction * (-1, 1, 1), found.direction) < 5
    )  # places lie on a spiral, which has no mirror image


def test_what_is_outside_the_mask_and_the_number_of_threads_change_nothing() -> None:
    rng = np.random.default_rng(1)
    network, (image, mask) = small_network(rng), photo(rng)
    found = numbers(predict_light(image, mask, network))
    padded = np.pad(
        np.where(mask[..., None], image, 7), ((13, 4), (3, 21), (0, 0)), constant_values=9
    )
    for threads in (1, 3):
        with threadpool_limits(threads):
            np.testing.assert_array_equal(
                numbers(predict_light(padded, np.pad(mask, ((13, 4), (3, 21))), network)), found
            )


@pytest.mark.parametrize("level", [0.0, 1e-30, 1.0])
def test_photos_without_anything_in_them_are_judged_too(level: float) -> None:
    assert np.isfinite(
        numbers(predict_light(np.full((9, 9, 3), level, np.float32), np.eye(9, dtype=bool)))
    ).all()


def test_the_cone_holds_two_thirds_of_the_places() -> None:
    toward = np.array([0.3, 0.0, np.sqrt(0.91)])
    for sharp in (6, 12, 25):
        places = np.exp(sharp * (PLACES @ toward))
        light_estimate = LightEstimate(0, 1, 0, places / places.sum(), np.zeros(8), np.ones(8))
        assert off(light_estimate.direction, toward) < 3
        # Of a density exp(k cos) 1 - e^(-k (1 - cos)) lies within an angle; the network's places
        # are blurred by one of k = 1 / 8 degrees^2.
        wide, blur = (np.arccos(1 + np.log(0.32) / k) for k in (sharp, np.radians(8) ** -2))
        assert light_estimate.cone == pytest.approx(np.degrees(np.sqrt(wide**2 - blur**2)), rel=0.1)


def test_a_cone_is_never_a_point_and_one_that_is_half_the_sky_tells_nothing() -> None:
    sure, unsure = (np.exp(k * PLACES[:, 2]) for k in (400, 1))
    found = [
        LightEstimate(0, 1, 0, places / places.sum(), np.zeros(8), np.ones(8))
        for places in (sure, unsure)
    ]
    assert found[0].cone == 4 and found[0].determined and not found[1].determined
    assert not LightEstimate(0.6, 0.4, 0, found[0].places, np.zeros(8), np.ones(8)).determined


@pytest.mark.parametrize(
    "toward",
    [
        (-0.5, 0.5, 0.7),
        (0.6, 0.3, 0.7),
        (0.1, 0.8, 0.6),
        (0.2, 0.1, 0.9),
        (-0.7, -0.1, 0.5),
        (0.3, -0.6, 0.7),
    ],
)
def test_the_lamp_of_a_painted_ball_is_found(toward: tuple[float, float, float]) -> None:
    found = predict_light(*under_lights(toward))
    assert found.one > 0.5
    assert off(found.direction, np.array(toward)) < 15


def test_three_lamps_are_several_and_smooth_light_is_none() -> None:
    assert (
        predict_light(*under_lights((-0.8, 0.4, 0.7), (0.8, 0.3, 0.7), (0.1, -0.8, 0.7))).several
        > 0.7
    )
    normal, mask = ball()
    smooth = np.exp(0.5 * normal[..., 1:2] + 0.2 * normal[..., :1]) * (0.5, 0.3, 0.2)
    assert predict_light((smooth * mask[..., None]).astype(np.float32), mask).none > 0.5


def test_files_that_hold_no_network_are_refused(tmp_path: Path) -> None:
    bad = tmp_path / "bad.npz"
    bad.write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"bad\.npz is not a light network"):
        LightNetwork.read(bad)
    network = small_network(np.random.default_rng(2))
    parts = {f"weight{k:02d}": values for k, values in enumerate(network.weights)}
    parts |= {f"bias{k:02d}": values for k, values in enumerate(network.biases)}
    parts |= {"middle": network.middle, "scale": network.scale}
    for name, (matrix, added) in network.layers.items():
        parts |= {f"{name}_weight": matrix, f"{name}_bias": added}
    for wrong in (
        {"local_weight": np.ones((9, 7))},
        {"lamps_bias": np.ones(4)},
        {"bias01": np.ones(3)},
        {"weight00": np.ones((9, 3, 4))},
    ):
        np.savez(bad, **(parts | wrong))
        with pytest.raises(InputError, match="not the weights"):
            LightNetwork.read(bad)
    np.savez(bad, **{name: values for name, values in parts.items() if name != "places_bias"})
    with pytest.raises(InputError, match="places_bias"):
        LightNetwork.read(bad)
    np.savez(bad, **(parts | {"scale": np.full(10, np.nan)}))
    with pytest.raises(InputError, match="not finite"):
        LightNetwork.read(bad)
    np.savez(bad, **parts)
    assert len(LightNetwork.read(bad).weights) == 4
