"""Materials and their textures: values at texel centres, the seam, the ends, and bad input."""

from typing import Any

import numpy as np
import pytest

from isc_core.errors import InputError
from synth.scene.materials import DIFFUSE_MODELS, MODELS, Material, texture_at

GREY = np.full((2, 2, 3), 0.5)


def centres(rows: int, columns: int) -> np.ndarray:
    v, u = np.meshgrid(
        (np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij"
    )
    return np.stack([u.ravel(), v.ravel()], axis=1)


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (1, 1), (1, 4, 3)])
def test_texel_centres_give_the_texels(shape: tuple[int, ...]) -> None:
    texture = np.random.default_rng(0).uniform(size=shape)
    np.testing.assert_allclose(
        texture_at(texture, centres(*shape[:2])), texture.reshape(-1, *shape[2:]), atol=1e-12
    )


def test_a_plane_is_interpolated_exactly() -> None:
    uv = np.random.default_rng(1).uniform(0.1, 0.9, (200, 2))
    v, u = np.meshgrid((np.arange(16) + 0.5) / 16, (np.arange(16) + 0.5) / 16, indexing="ij")
    np.testing.assert_allclose(
        texture_at(2 * u - 3 * v, uv), 2 * uv[:, 0] - 3 * uv[:, 1], atol=1e-12
    )


def test_u_wraps_around_and_v_stops() -> None:
    texture = np.array([[0.0, 1.0, 2.0, 3.0], [10.0, 11.0, 12.0, 13.0]])
    uv = np.random.default_rng(2).uniform(size=(50, 2))
    np.testing.assert_allclose(
        texture_at(texture, uv + (1, 0)), texture_at(texture, uv), atol=1e-12
    )
    np.testing.assert_allclose(texture_at(texture, np.array([[0.0, 0.25], [1.0, 0.25]])), 1.5)
    np.testing.assert_allclose(
        texture_at(texture, np.array([[0.125, -2.0], [0.125, 0.0], [0.125, 1.0], [0.125, 9.0]])),
        [0, 0, 10, 10],
    )


def test_reflectance_at_a_point_is_that_of_the_material() -> None:
    rng = np.random.default_rng(3)
    albedo, gloss, strength = (
        rng.uniform(size=(6, 4, 3)),
        rng.uniform(5, 500, (3, 5)),
        rng.uniform(size=(2, 2)),
    )
    material = Material(albedo, "blinn_phong", gloss, strength)
    np.testing.assert_allclose(material.at(centres(6, 4)).albedo, albedo.reshape(-1, 3))
    np.testing.assert_allclose(material.at(centres(3, 5)).gloss, gloss.ravel())
    np.testing.assert_allclose(material.at(centres(2, 2)).strength, strength.ravel())
    assert (Material(GREY, "ggx", 0.3, 2.0).at(centres(3, 3)).gloss == 0.3).all()


@pytest.mark.parametrize("model", MODELS)
def test_only_glossy_models_have_gloss(model: Any) -> None:
    material = Material(GREY, model, 0.2 if model in ("ggx", "roughplastic") else 50.0, 1.0)
    paint = material.at(centres(2, 2))
    assert (
        material.is_diffuse
        == (model in DIFFUSE_MODELS)
        == (not paint.strength.any())
        == (not paint.gloss.any())
    )


def test_f0_is_that_of_glass() -> None:
    assert Material(GREY, "ggx", 0.1, 1.0, ior=1.5).f0 == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"model": "velvet"}, "unknown material 'velvet': choose lambert"),
        ({"albedo": GREY * 2.1}, "albedo"),
        ({"albedo": -GREY}, "albedo"),
        ({"albedo": np.full((2, 2, 3), np.nan)}, "albedo"),
        ({"albedo": np.ones((2, 2))}, "albedo"),
        ({"albedo": np.ones((0, 2, 3))}, "albedo"),
        ({"ior": 1.0}, "ior"),
        ({"ior": float("nan")}, "ior"),
        ({"sigma": 2.0}, "sigma"),
        ({"gloss": 0.5}, "gloss of blinn_phong"),
        ({"gloss": np.array([[5.0, np.nan]])}, "gloss of blinn_phong"),
        ({"gloss": np.full((2, 2, 3), 9.0)}, "texture"),
        ({"gloss": np.ones((0, 3))}, "texture"),
        ({"gloss": np.full(3, 9.0)}, "texture"),
        ({"strength": np.full(3, 0.1)}, "texture"),
        ({"model": "ggx", "gloss": 1.5}, "gloss of ggx"),
        ({"strength": -0.1}, "strength"),
        ({"strength": float("inf")}, "strength"),
        ({"model": "roughplastic", "gloss": 0.1, "strength": 0.5}, "uniform gloss"),
        (
            {"model": "roughplastic", "gloss": np.full((2, 2), 0.1), "strength": 1.0},
            "uniform gloss",
        ),
    ],
)
def test_impossible_materials_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Material(**{"albedo": GREY, **values})
