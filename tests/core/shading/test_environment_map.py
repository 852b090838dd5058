"""The recovered light as an environment: same shading, never negative, the right way round."""

from collections.abc import Callable

import numpy as np
import pytest

from isc_core.shading.environment_map import (
    directions,
    environment_from_shading,
    mean_radiance,
    recovered_environment,
    resampled,
    shading_under,
    solid_angles,
)
from isc_core.shading.spherical_harmonics import real_sh


def facing_normals(count: int) -> np.ndarray:
    normals = np.random.default_rng(5).normal(size=(count, 3))
    normals[:, 2] = np.abs(normals[:, 2])
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def test_the_sky_covers_the_sphere() -> None:
    towards, solid_angle = directions(16), solid_angles(16)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=-1), 1, atol=1e-12)
    np.testing.assert_allclose(solid_angle.sum(), 4 * np.pi, rtol=1e-12)
    np.testing.assert_allclose((towards * solid_angle[..., None]).sum((0, 1)), 0, atol=1e-12)


def test_up_right_and_toward_the_viewer_are_where_mitsuba_has_them() -> None:
    towards = directions(64)
    np.testing.assert_allclose(towards[0].mean(0), [0, 1, 0], atol=0.03)
    np.testing.assert_allclose(towards[31:33, 31:33].mean((0, 1)), [1, 0, 0], atol=0.03)
    np.testing.assert_allclose(towards[31:33, 63:65].mean((0, 1)), [0, 0, 1], atol=0.03)


def test_a_constant_light_is_a_uniform_sky() -> None:
    light = np.zeros((9, 3))
    light[0] = np.log([0.2, 0.5, 2.0]) * np.sqrt(4 * np.pi)
    env_map = environment_from_shading(light, rows=16)
    np.testing.assert_allclose(
        shading_under(env_map, facing_normals(50)), [[0.2, 0.5, 2.0]] * 50, rtol=0.02
    )


def found_light(seed: int) -> np.ndarray:
    """A light of the strength that decompositions find."""
    scale = np.array([0.5, *[0.5] * 3, *[0.15] * 5])[:, None]
    return np.asarray(np.random.default_rng(seed).normal(size=(9, 3)) * scale)


@pytest.mark.slow
@pytest.mark.parametrize("find", [environment_from_shading, recovered_environment])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_sky_gives_the_recovered_shading(
    seed: int, find: Callable[[np.ndarray], np.ndarray]
) -> None:
    """Not every contrast is within an environment map's reach: some error remains."""
    light = found_light(seed)
    env_map = find(light)
    normals = facing_normals(400)
    error = np.abs(shading_under(env_map, normals) / np.exp(real_sh(normals) @ light) - 1)
    assert env_map.min() >= 0
    assert np.isfinite(env_map).all()
    assert np.median(error) < 0.02
    assert error.max() < 0.2


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_no_bright_spot_stands_behind_the_object(seed: int) -> None:
    """Few normals face those directions, which are poorly constrained: there must be no lamp."""
    light, behind = found_light(seed), directions(16)[..., 2] < -0.9
    env_map = recovered_environment(light, 16)
    assert env_map[behind].max() < 2 * env_map.mean() < environment_from_shading(light, 16).max()


def test_light_from_the_left_comes_from_the_left() -> None:
    light = np.zeros((9, 3))
    light[3] = -1  # log shading falls with x
    env_map, towards = environment_from_shading(light, rows=16), directions(16)
    assert env_map[towards[..., 0] < -0.5].mean() > 3 * env_map[towards[..., 0] > 0.5].mean()


@pytest.mark.parametrize("rows", [7, 16, 24, 32, 51])
def test_resampling_loses_no_light_from_any_side(rows: int) -> None:
    """Exact for the sum; what stays within a pixel keeps its moment only as far as the larger
    pixels tell.
    """
    env_map = np.random.default_rng(4).gamma(0.3, size=(24, 48, 3))
    other = resampled(env_map, rows)
    assert other.shape == (rows, 2 * rows, 3)
    light, kept = ((r * solid_angles(len(r))[..., None]).sum((0, 1)) for r in (env_map, other))
    np.testing.assert_allclose(kept, light, rtol=1e-12)
    np.testing.assert_allclose(
        shading_under(other, facing_normals(40)),
        shading_under(env_map, facing_normals(40)),
        rtol=0.15,
    )
    assert other.min() >= env_map.min() and other.max() <= env_map.max() * (1 + 1e-12)


def test_resampling_to_the_same_rows_changes_nothing_and_to_more_can_be_undone() -> None:
    env_map = np.random.default_rng(4).random((6, 12, 3))
    np.testing.assert_allclose(resampled(env_map, 6), env_map, rtol=1e-12)
    np.testing.assert_allclose(resampled(resampled(env_map, 18), 6), env_map, rtol=1e-12)
    assert resampled(env_map.astype(np.float32), 3).dtype == np.float32


def test_a_mean_radiance_is_over_directions() -> None:
    """A polar cap of 60 degrees is a quarter of the sphere and a third of the rows."""
    sky = np.zeros((48, 96, 3))
    sky[:16] = (4, 8, 12)
    np.testing.assert_allclose(mean_radiance(sky), (1, 2, 3))
