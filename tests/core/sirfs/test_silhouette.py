"""What the outline says of the inside: outward at the rim, nothing outside, and true on a half
ball.
"""

import numpy as np
import pytest

from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.priors.priors import SilhouetteProfile
from isc_core.sirfs.silhouette import (
    normals_cost,
    normals_from_silhouette,
    silhouette_coordinates,
    silhouette_normals,
)


def disc(size: int = 81, radius: float = 34.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    i, j = np.mgrid[:size, :size] - (size - 1) / 2
    return np.hypot(i, j) < radius, i, j


def test_depth_and_direction_on_a_disc() -> None:
    mask, i, j = disc()
    u, down, right = silhouette_coordinates(mask)
    radius = np.hypot(i, j)
    assert u[mask].min() > 0 and u.max() == 1 and (u[~mask] == 0).all()
    np.testing.assert_allclose(u[mask], (1 - radius / 34)[mask], atol=0.05)
    away = mask & (radius > 6)
    assert ((down * i + right * j) / np.maximum(radius, 1))[away].min() > 0.97


def test_there_is_no_silhouette_where_the_border_cuts_the_object() -> None:
    whole, _, _ = disc()
    u, down, right = silhouette_coordinates(whole)
    middle = whole.shape[1] // 2
    cut_u, cut_down, cut_right = silhouette_coordinates(whole[:, : middle + 1])
    near = (slice(None), slice(middle - 8, middle + 1))
    inside = whole[near]
    np.testing.assert_allclose(cut_u[near][inside], u[near][inside], atol=0.05)
    away = inside & (u[near] < 0.7)
    assert (cut_down[near] * down[near] + cut_right[near] * right[near])[away].min() > 0.97


def test_the_field_is_empty_outside_and_finite_on_any_mask() -> None:
    profile = SilhouetteProfile(np.array([0.9, 0.1]), np.array([0.2, 0.3]))
    masks = [disc()[0], np.zeros((5, 6), bool), np.ones((5, 6), bool), np.eye(7, dtype=bool)]
    for mask in masks:
        field = normals_from_silhouette(mask, profile)
        for values in (field.down, field.right, field.precision, field.dome):
            assert np.isfinite(values).all() and (values[~mask] == 0).all()


@pytest.mark.parametrize("sign", [1, -1])
def test_a_half_ball_costs_less_than_flat_and_a_hollow_more(sign: int) -> None:
    mask, i, j = disc()
    height = sign * np.sqrt(np.maximum(36.0**2 - i * i - j * j, 1))
    profile = SilhouetteProfile(np.linspace(0.95, 0.05, 10), np.full(10, 0.2))
    field = normals_from_silhouette(mask, profile)
    n1, n2, _ = np.moveaxis(normals(height), -1, 0)
    flat = normals_cost(0 * n1, 0 * n2, mask, field, 1.0)[0]
    cost = normals_cost(n1, n2, mask, field, 1.0)[0]
    assert cost < 0.2 * flat if sign == 1 else cost > 2 * flat


def test_the_dome_leans_as_the_profile_says_on_average() -> None:
    """The profile of a half ball gives a half ball back."""
    mask, i, j = disc()
    depth = (np.arange(64) + 0.5) / 64
    profile = SilhouetteProfile(1 - depth, np.full(64, 0.2))
    height = normals_from_silhouette(mask, profile).dome
    ball = np.sqrt(np.maximum(34.0**2 - i * i - j * j, 0))
    assert (height[~mask] == 0).all()
    np.testing.assert_allclose(height[mask], ball[mask], atol=5)
    # The steepest part at the very rim falls between two pixels.
    np.testing.assert_allclose(height[40, 15:66] - height[40, 40], ball[40, 15:66] - 34, atol=1)


def test_a_dome_scales_with_its_outline_and_does_not_end_where_the_photo_does() -> None:
    profile = SilhouetteProfile(np.array([0.6, 0.1]), np.array([0.2, 0.3]))
    small, large = (
        normals_from_silhouette(m, profile).dome for m in (disc()[0], disc(161, 68.0)[0])
    )
    assert large.max() == pytest.approx(2 * small.max(), rel=0.03)
    mask, _, _ = disc()
    cut = normals_from_silhouette(mask[:, :41], profile).dome
    np.testing.assert_allclose(
        cut[20:60, 36:], normals_from_silhouette(mask, profile).dome[20:60, 36:41], atol=1
    )
    for other in (np.zeros((5, 6), bool), np.ones((5, 6), bool), np.eye(7, dtype=bool)):
        assert np.isfinite(normals_from_silhouette(other, profile).dome).all()


def test_normals_of_the_outline_lean_outward_as_the_profile_says() -> None:
    mask, i, j = disc()
    profile = SilhouetteProfile(np.array([0.8, 0.4, 0.1]), np.full(3, 0.3))
    normal = silhouette_normals(mask, profile)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1, atol=1e-12)
    assert (normal[~mask] == (0, 0, 1)).all() and normal[40, 40, 2] > 0.99
    rim = mask & (np.hypot(i, j) > 32)
    assert np.hypot(normal[..., 0], normal[..., 1])[rim].mean() == pytest.approx(0.8, abs=0.05)
    assert normal[40, 70, 0] > 0.5 and normal[10, 40, 1] > 0.5, "x to the right, y up"
