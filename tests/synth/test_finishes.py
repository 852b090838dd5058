"""Random materials: within their ranges, and in the right gloss class."""

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.shading.brdf.roughness import fitted_exponent
from synth.capture.finishes import (
    EXPONENTS,
    FACET_STRENGTHS,
    FINISHES,
    STRENGTHS,
    VARYING,
    gloss_class,
    make_material,
)
from synth.scene.materials import MODELS, Material

WHITE = np.full((2, 3, 3), 0.5)
GLOSSY = ("blinn_phong", "ggx", "roughplastic")


def drawn(model: str, count: int, varying: bool | None = None) -> list[Material]:
    rng = np.random.default_rng(11)
    return [make_material(model, WHITE, rng, varying) for _ in range(count)]


def exponent(material: Material) -> np.ndarray:
    return (
        np.asarray(material.gloss)
        if material.model == "blinn_phong"
        else fitted_exponent(material.gloss)
    )


def test_every_model_can_be_drawn() -> None:
    assert FINISHES == MODELS
    for model in FINISHES:
        material = make_material(model, WHITE, np.random.default_rng(0))
        assert material.model == model
        assert material.albedo is WHITE


@pytest.mark.parametrize("model", FINISHES)
def test_the_same_seed_draws_the_same_material(model: str) -> None:
    first, again, other = (
        make_material(model, WHITE, np.random.default_rng(seed)) for seed in (2, 2, 3)
    )
    for name in ("gloss", "strength", "ior", "sigma"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    if model != "lambert":
        assert any(
            np.any(getattr(first, name) != getattr(other, name)) for name in ("gloss", "sigma")
        )


@pytest.mark.parametrize("model", GLOSSY)
def test_gloss_is_log_uniform_over_its_range(model: str) -> None:
    values = np.log([float(exponent(material)) for material in drawn(model, 800, False)])
    low, high = np.log(EXPONENTS)
    assert values.min() >= low - 1e-9
    assert values.max() <= high + 1e-9
    counts = np.histogram(values, 8, (low, high))[0]
    assert np.square(counts - 100).sum() / 100 < 24.3  # chi-square of 7 degrees, one in a thousand


def test_strengths_and_iors_are_those_of_dielectrics() -> None:
    strengths = np.array([material.strength for material in drawn("blinn_phong", 400, False)])
    assert STRENGTHS[0] <= strengths.min() < 0.025
    assert 0.12 < strengths.max() <= STRENGTHS[1]
    for material in drawn("ggx", 200, False):
        assert FACET_STRENGTHS[0] <= material.strength <= FACET_STRENGTHS[1]
        assert 1.3 <= material.ior <= 1.8
    assert {material.strength for material in drawn("roughplastic", 20)} == {1.0}


@pytest.mark.parametrize("model", VARYING)
def test_varying_gloss_is_broader_where_it_is_weaker(model: str) -> None:
    spans = []
    for material in drawn(model, 30, True):
        strength, shine = np.asarray(material.strength), exponent(material)
        assert strength.shape == shine.shape == (256, 256)
        assert EXPONENTS[0] * (1 - 1e-9) <= shine.min()
        assert shine.max() <= EXPONENTS[1] * (1 + 1e-9)
        order = np.argsort(strength, axis=None)
        assert (np.diff(shine.ravel()[order]) >= -1e-6 * shine.max()).all()
        spans.append(strength.min() / strength.max())
        seam, inside = (
            np.abs(strength[:, 0] - strength[:, -1]).mean(),
            np.abs(np.diff(strength, axis=1)).mean(),
        )
        assert seam <= 3 * inside + 1e-12
    assert min(spans) >= 0.1 - 1e-9
    assert np.median(spans) < 0.8


@pytest.mark.slow
def test_gloss_varies_one_time_in_four_by_default() -> None:
    varied = np.mean([np.ndim(material.gloss) == 2 for material in drawn("ggx", 600)])
    assert abs(varied - 0.25) < 4 * np.sqrt(0.25 * 0.75 / 600)
    assert not any(
        np.ndim(material.gloss) for model in FINISHES for material in drawn(model, 30, False)
    )
    assert not any(np.ndim(material.gloss) for material in drawn("roughplastic", 30))


@pytest.mark.parametrize(
    ("gloss", "expected"),
    [(5, "broad"), (29, "broad"), (31, "medium"), (299, "medium"), (301, "sharp")],
)
def test_classes_by_exponent(gloss: float, expected: str) -> None:
    assert gloss_class(Material(WHITE, "blinn_phong", gloss)) == expected
    assert gloss_class(Material(WHITE, "blinn_phong", np.array([[1.0, gloss, 9000.0]]))) == expected


def test_classes_by_alpha() -> None:
    """Alpha .22 is an exponent of 30, .073 of 300, by the fitted formula."""
    for model in ("ggx", "roughplastic"):
        found = [
            gloss_class(Material(WHITE, model, alpha, strength=1.0))
            for alpha in (1.0, 0.5, 0.23, 0.21, 0.075, 0.072, 0.01)
        ]
        assert found == ["broad", "broad", "broad", "medium", "medium", "sharp", "sharp"]


def test_materials_without_specular_lobe_are_diffuse() -> None:
    assert {
        gloss_class(material) for model in ("lambert", "oren_nayar") for material in drawn(model, 5)
    } == {"diffuse"}
    assert gloss_class(Material(WHITE, "ggx", 0.1, strength=0.0)) == "diffuse"


def test_all_classes_are_drawn() -> None:
    assert {gloss_class(material) for material in drawn("blinn_phong", 60)} == {
        "broad",
        "medium",
        "sharp",
    }


def test_what_cannot_be_made_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="unknown material 'velvet': choose lambert"):
        make_material("velvet", WHITE, rng)
    for model in ("roughplastic", "lambert", "oren_nayar"):
        with pytest.raises(InputError, match="cannot vary"):
            make_material(model, WHITE, rng, True)
    with pytest.raises(InputError, match="albedo"):
        make_material("ggx", WHITE * 3, rng)
