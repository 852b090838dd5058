"""Radiance under directional lights, environments and our own light."""

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.shading.brdf.energy import directional_albedo
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.brdf.lambert import Lambert
from isc_core.shading.lobe_rendering import Lobe, lobe_in_environment
from isc_core.shading.radiance import DistantLights, directional, environment, radiance, sh_shading
from isc_core.shading.spherical_harmonics import real_sh

from .brdf.directions_at import GLOSSY_PLASTIC, UP, polar_units, random_units


def env_map(rows: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Directions (K, 3) over the whole sphere and their solid angles (K,)."""
    cosine, weight = np.polynomial.legendre.leggauss(rows)
    azimuth = (np.arange(2 * rows) + 0.5) * np.pi / rows
    weights = np.broadcast_to(weight[:, None] * np.pi / rows, (rows, 2 * rows))
    return polar_units(cosine[:, None], azimuth).reshape(-1, 3), weights.ravel()


def test_a_matt_sphere_under_one_light_is_the_clamped_cosine() -> None:
    normal, light = random_units(20, 30), random_units(seed=4)
    seen = radiance(Lambert(0.5), normal, UP, directional(light, np.pi * np.array([1, 2, 3.0])))
    expected = 0.5 * np.maximum(normal @ light, 0) * (normal @ UP > 0)
    assert np.allclose(seen, expected[..., None] * [1, 2, 3])


@pytest.mark.parametrize("at_a_time", [1, 100, 1000])  # groups of 1, 2 and all lights
def test_lights_add_up(at_a_time: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("isc_core.shading.radiance._MOST_VALUES", at_a_time)
    normal, lights = (
        random_units(50),
        DistantLights(random_units(3, seed=7), np.random.default_rng(1).uniform(0, 2, (3, 3))),
    )
    together = radiance(GLOSSY_PLASTIC, normal, UP, lights)
    alone = [
        radiance(GLOSSY_PLASTIC, normal, UP, directional(*pair))
        for pair in zip(lights.directions, lights.irradiance, strict=True)
    ]
    assert together.shape == (50, 3) and together.max() > 0
    assert np.allclose(together, sum(alone))


@pytest.mark.slow
def test_a_white_sky_shows_what_a_surface_keeps() -> None:
    directions, weights = env_map(28)
    white = environment(directions, weights, np.ones((len(weights), 3)))
    for cos_view in (0.9, 0.5):
        for model in (Lambert(0.6), Ggx(0.5, 0.8), GLOSSY_PLASTIC):
            seen = radiance(model, UP, polar_units(np.array(cos_view)), white)
            assert np.allclose(seen, directional_albedo(model, cos_view), rtol=5e-3)


@pytest.mark.slow
def test_a_cosine_sky_on_a_matt_surface_has_a_closed_form() -> None:
    """Radiance 1 + cos of the angle from the top: the irradiance is pi (1 + 2/3 n_z), as order 1
    harmonics say.
    """
    directions, weights = env_map(60)
    light = environment(directions, weights, np.repeat(1 + directions[:, 2:], 3, axis=1))
    normal = polar_units(np.array([1.0, 0.8, 0.3]))
    seen = radiance(Lambert(1.0), normal, normal, light)
    assert np.allclose(seen, 1 + 2 / 3 * normal[:, 2:], rtol=2e-3)


@pytest.mark.parametrize("lobe", [Lobe(1e4), Lobe(alpha=0.01)])
def test_a_narrow_lobe_mirrors_an_even_sky_evenly(lobe: Lobe) -> None:
    tilt = np.linspace(0, np.radians(35), 12)
    normals = np.stack([0.6 * np.sin(tilt), 0.8 * np.sin(tilt), np.cos(tilt)], axis=-1)
    seen = lobe_in_environment(lobe, normals, np.ones((16, 32, 3)))[:, 0]
    albedo = [directional_albedo(lobe.model, cosine) for cosine in normals[:, 2]]
    np.testing.assert_allclose(seen, albedo, rtol=0.12)


def test_our_light_is_the_exponential_of_harmonics() -> None:
    normal, coefficients = random_units(6, 5), np.random.default_rng(2).normal(size=(9, 3))
    shading = sh_shading(normal, coefficients)
    assert np.allclose(np.log(shading), real_sh(normal) @ coefficients)
    flat = np.zeros((9, 3))
    flat[0] = np.log([0.5, 1, 2]) * np.sqrt(4 * np.pi)
    assert np.allclose(sh_shading(normal, flat), [0.5, 1, 2])
    flat[:] = 0
    flat[1] = np.sqrt(4 * np.pi / 3)
    assert np.allclose(np.log(sh_shading(normal, flat))[..., 0], normal[..., 1])


def test_unfit_lights_are_refused() -> None:
    with pytest.raises(InputError, match="irradiance"):
        directional(UP, -1.0)
    with pytest.raises(InputError, match="length 1"):
        directional(2 * UP)
    with pytest.raises(InputError, match="same K"):
        DistantLights(np.zeros((0, 3)), np.zeros((0, 3)))
    with pytest.raises(InputError, match="weights"):
        environment(random_units(4), np.ones(4), np.ones((3, 3)))
    with pytest.raises(InputError, match="weights"):
        environment(random_units(4), -np.ones(4), np.ones((4, 3)))
    with pytest.raises(InputError, match="coefficients"):
        sh_shading(UP, np.zeros((3, 9)))
    with pytest.raises(InputError, match="overflows"):
        sh_shading(UP, np.full((9, 3), 1e4))
