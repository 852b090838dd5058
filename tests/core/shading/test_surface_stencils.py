"""Derivatives of heights: exact on quadratics, adjoint to their adjoints, right on a plane and a
sphere.
"""

import numpy as np
import pytest

from isc_core.shading.surface_stencils import (
    DERIVATIVES,
    Stencil,
    derivative,
    derivative_adjoint,
    fold_border,
    normals,
)
from isc_core.sirfs.priors.tabulated_potential import TabulatedPotential
from isc_core.sirfs.surface import geometry, pair_slices


@pytest.mark.parametrize("stencil", DERIVATIVES)
@pytest.mark.parametrize("shape", [(7, 9), (1, 5), (2, 2)])
def test_adjoints(stencil: Stencil, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    height, gradient = rng.normal(size=(2, *shape))
    forward = float((derivative(np.pad(height, 1, mode="edge"), stencil) * gradient).sum())
    assert forward == pytest.approx(
        float((height * derivative_adjoint(gradient, stencil)).sum()), rel=1e-12, abs=1e-13
    )


def test_fold_border_is_the_adjoint_of_replicating_it() -> None:
    rng = np.random.default_rng(1)
    height, wide = rng.normal(size=(4, 5)), rng.normal(size=(6, 7))
    forward = float((np.pad(height, 1, mode="edge") * wide).sum())
    assert forward == pytest.approx(float((height * fold_border(wide.copy())).sum()))


def test_derivatives_of_a_quadratic_are_exact() -> None:
    i, j = np.mgrid[:9, :11].astype(float)
    height = 0.3 * i * i - 0.2 * j * j + 0.7 * i * j + 2 * i - 3 * j
    zi, zj, zii, zjj, zij = (
        derivative(np.pad(height, 1, mode="edge"), s)[1:-1, 1:-1] for s in DERIVATIVES
    )
    np.testing.assert_allclose(zi, (0.6 * i + 0.7 * j + 2)[1:-1, 1:-1], atol=1e-12)
    np.testing.assert_allclose(zj, (-0.4 * j + 0.7 * i - 3)[1:-1, 1:-1], atol=1e-12)
    np.testing.assert_allclose(zii, 0.6, atol=1e-12)
    np.testing.assert_allclose(zjj, -0.4, atol=1e-12)
    np.testing.assert_allclose(zij, 0.7, atol=1e-12)


def test_normals_of_a_plane() -> None:
    """A surface that rises downward and to the right faces up and to the left."""
    i, j = np.mgrid[:8, :8].astype(float)
    inner = normals(0.5 * i + 0.25 * j)[1:-1, 1:-1]
    np.testing.assert_allclose(
        inner,
        np.broadcast_to(np.array([-0.5, -0.25, 1]) / np.sqrt(1 + 0.25 + 0.0625), inner.shape),
        atol=1e-14,
    )


def test_normals_and_curvature_of_a_sphere() -> None:
    radius = 60.0
    i, j = np.mgrid[-30:31, -30:31].astype(float)
    height = np.sqrt(radius**2 - i * i - j * j)
    true = np.stack([i, j, height], axis=-1) / radius
    away = np.degrees(np.arccos(np.clip((normals(height) * true).sum(-1), -1, 1)))[1:-1, 1:-1]
    assert away.max() < 0.1
    # the sphere bends away from the viewer: negative, 1 / radius in size
    np.testing.assert_allclose(geometry(height).curvature[1:-1, 1:-1], -1 / radius, rtol=2e-3)


def test_float32_keeps_the_curvature_of_a_large_distant_sphere() -> None:
    i, j = np.mgrid[-20:21, -20:21].astype(float)
    height = (np.sqrt(400.0**2 - i * i - j * j) - 380).astype(np.float32)
    exact = geometry(height.astype(float)).curvature
    assert np.abs(geometry(height).curvature - exact).max() < 1e-5 * np.abs(exact).max()


@pytest.mark.parametrize("offset", [(0, 1), (0, 2), (1, -2), (1, 0), (2, 2), (2, -1)])
def test_pair_slices_select_the_offset(offset: tuple[int, int]) -> None:
    i, j = np.mgrid[:5, :6]
    p, q = pair_slices(*offset)
    assert (i[q] - i[p] == offset[0]).all() and (j[q] - j[p] == offset[1]).all()
    assert i[p].size == (5 - offset[0]) * (6 - abs(offset[1]))


def test_table_interpolates_and_goes_on_straight() -> None:
    table = TabulatedPotential(-1.0, 0.5, np.array([4.0, 1.0, 0.0, 2.0]))
    cost, slope = table.evaluate(np.array([-1.0, -0.75, -0.5, 0.25, 0.5, 3.0, -2.0]))
    np.testing.assert_allclose(cost, [4, 2.5, 1, 1, 2, 12, 10])
    np.testing.assert_allclose(slope, [-6, -6, -2, 4, 4, 4, -6])
