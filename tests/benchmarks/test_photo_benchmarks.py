"""The benchmarks of photos: a perfect result has no error, and errors are those put in."""

from types import SimpleNamespace

import numpy as np

from benchmarks.decomposition.photo_illumination import Scene, measured, report
from benchmarks.decomposition.white_balance import changes, light_ratio


def result(reflectance: np.ndarray, normal: np.ndarray) -> SimpleNamespace:
    mask = np.ones(normal.shape[:2], bool)
    return SimpleNamespace(reflectance=reflectance, normal=normal, mask=mask)


def test_scale_does_not_count_and_colour_and_normals_do() -> None:
    rng = np.random.default_rng(0)
    reflectance = rng.uniform(0.2, 0.8, (6, 6, 3))
    normal = np.broadcast_to(np.array([0.0, 0, 1]), (6, 6, 3))
    tilted = np.broadcast_to(np.array([0.0, np.sin(0.1), np.cos(0.1)]), (6, 6, 3))
    scene = Scene(reflectance, np.ones((6, 6), bool), normal, reflectance, 1.0)
    exact = measured(scene, result(3 * reflectance, normal))  # type: ignore[arg-type]
    np.testing.assert_allclose(exact, 0, atol=1e-5)
    off = measured(scene, result(reflectance * [1.2, 1, 1], tilted))  # type: ignore[arg-type]
    assert off[0] > 2 and off[1] > 1e-3
    np.testing.assert_allclose(off[2], np.degrees(0.1), rtol=1e-6)


def test_the_table_compares_with_the_first_way() -> None:
    errors = np.array([[[2.0, 4.0, 8.0], [1.0, 4.0, 4.0]]] * 5)
    assert "| b | 1, 0.50 (0.50-0.50); 0.50 | 4, 1.00 (1.00-1.00); 1.00 |" in report(
        ["a", "b"], errors
    )


def test_reflectance_that_moves_with_the_photo_is_not_off() -> None:
    factor = np.array([1.1, 1.0, 0.9])
    normal = np.broadcast_to(np.array([0.0, 0, 1]), (4, 4, 3))
    before, after = (
        result(np.ones((4, 4, 3)), normal),
        result(2 * factor * np.ones((4, 4, 3)), normal),
    )
    angle, off = changes(before, after, factor)  # type: ignore[arg-type]
    assert angle == 0 and off < 1e-9
    assert changes(before, before, factor)[1] > 0.05  # type: ignore[arg-type]


def test_the_ratio_of_a_light_of_known_colour() -> None:
    light = np.zeros((9, 3))
    light[0] = np.log([2.0, 1.0, 1.0]) * np.sqrt(4 * np.pi)
    np.testing.assert_allclose(light_ratio(light), 2)
