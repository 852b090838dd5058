"""The base colour under a specular layer."""

import numpy as np
import pytest

from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.lobe_fitting.specular_layer import CoatedSurface, specular_share


def dome(size: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """Normals (size, size, 3), 0 outside, and the mask of a half sphere."""
    axis = np.linspace(-1.05, 1.05, size)
    x, y = np.meshgrid(axis, -axis)
    mask = x * x + y * y < 0.97
    z = np.sqrt(np.where(mask, 1 - x * x - y * y, 1))
    return np.where(mask[..., None], np.stack([x, y, z], -1), 0), mask


def evenly_lit(radiance: float = 0.7, variation: np.ndarray | None = None) -> CoatedSurface:
    normal, _ = dome()
    environment = np.full((16, 32, 3), radiance)
    shading = np.full(normal.shape, radiance)
    return CoatedSurface(normal, shading, environment, variation=variation)


@pytest.mark.parametrize("roughness", [0.05, 0.4])
@pytest.mark.parametrize("level", [0.3, 1.0])
def test_under_an_even_sky_the_layer_is_not_seen(level: float, roughness: float) -> None:
    """What is left of the diffuse light and what the layer mirrors add up to the plain colour."""
    surface = evenly_lit()
    layer = surface.layer(level, roughness)
    assert layer is not None
    mask, color = surface.normal.any(-1), np.full(surface.normal.shape, 0.8)
    share = specular_share(level, roughness, surface.normal[mask][:, 2])[:, None]
    seen = layer.color_under(color)[mask] * (1 - share) + share
    facing = surface.normal[mask][:, 2] > 0.5
    np.testing.assert_allclose(seen[facing], 0.8, rtol=0.02)


def test_without_a_level_there_is_no_layer() -> None:
    assert evenly_lit().layer(0.0, 0.4) is None


def test_where_the_level_is_zero_the_color_stays() -> None:
    normal, mask = dome()
    variation = np.where(np.arange(normal.shape[1]) < 24, 0.0, 1.0) * np.ones(mask.shape)
    layer = evenly_lit(variation=variation).layer(1.0, 0.3)
    assert layer is not None
    under = layer.color_under(np.full(normal.shape, 0.5))
    left = mask & (variation == 0)
    np.testing.assert_allclose(under[left], 0.5)
    assert (under[mask & ~left & (normal[..., 2] > 0.5)] < 0.5).all()


def test_codes_are_those_of_the_colors() -> None:
    layer = evenly_lit().layer(1.5, 0.3)
    assert layer is not None
    codes = np.random.default_rng(3).integers(40, 255, (48, 48, 3)).astype(np.uint8)
    wanted = 255 * linear_to_srgb(np.clip(layer.color_under(srgb_to_linear(codes / 255)), 0, 1))
    assert np.abs(layer.codes_under(codes) - wanted).max() < 0.51
