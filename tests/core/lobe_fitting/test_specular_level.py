"""The specular level for renderers, on a ball of known lobe, light and albedo."""

from dataclasses import replace

import numpy as np
import pytest

from isc_core.lobe_fitting import RecoveredScene, fit_lobe
from isc_core.lobe_fitting.specular_level import SpecularSource, fitted_specular, specular_variation
from isc_core.scene.decomposition import Decomposition
from isc_core.scene.lobe_fit import Interval, LobeFit, LobeFitOptions, LobeFitOutcome, LobeModel
from isc_core.shading.brdf.ggx import Ggx
from isc_core.shading.radiance import directional, radiance
from tests.core.ball_scene import ball

TO_LIGHT = np.array([-0.3, 0.4, 0.866]) / np.linalg.norm([-0.3, 0.4, 0.866])
VIEW = np.array([0.0, 0.0, 1.0])


def lit(
    alpha: float,
    strength: float | np.ndarray,
    lamp: float = 2.0,
    env_map: float = 0.4,
    model: LobeModel = "ggx",
) -> Decomposition:
    """A ball under a light of irradiance `lamp` and an even environment map that is not mirrored;

    `strength`: of the lobe, 1 is f0 = .04.
    """
    d = ball()
    normal = d.normal.astype(float)
    inside = d.mask[..., None]
    gloss = (
        radiance(Ggx(alpha, 0.04), normal, VIEW, directional(TO_LIGHT, lamp))
        * np.asarray(strength)[..., None]
        * inside
    )
    shading = (
        (lamp / np.pi * np.maximum(normal @ TO_LIGHT, 0) + env_map)[..., None] * inside * np.ones(3)
    )
    return replace(
        d,
        specular=gloss.astype(np.float32),
        shading=shading,
        brdf=fit_lobe(gloss, normal, d.mask, options=LobeFitOptions(model)),
    )


@pytest.mark.slow
@pytest.mark.parametrize("strength", [0.3, 1.0, 4.0])
def test_roughness_and_level_are_the_scene_s(strength: float) -> None:
    gloss = fitted_specular(lit(0.2, strength))
    assert gloss.roughness == pytest.approx(0.2**0.5, rel=0.02)
    assert gloss.specular == pytest.approx(strength, rel=0.05)
    assert (gloss.roughness_source, gloss.specular_source) == (
        SpecularSource.FITTED,
        SpecularSource.FITTED,
    )
    assert gloss.variation is None


@pytest.mark.slow
def test_the_lamp_s_brightness_does_not_matter() -> None:
    dim, bright = (
        fitted_specular(lit(0.2, 0.6, lamp, env_map)).specular
        for lamp, env_map in ((1.0, 0.4), (8.0, 0.1))
    )
    assert dim == pytest.approx(bright, rel=0.03)


def test_a_lobe_of_blinn_and_phong_has_about_the_same_level() -> None:
    """Their shapes differ by a quarter; a factor of f0 would be 25."""
    assert fitted_specular(lit(0.2, 1.0, model="blinn_phong")).specular == pytest.approx(
        1.0, rel=0.5
    )


def test_a_lamp_that_the_shading_does_not_show_is_taken_to_be_all_of_it() -> None:
    d = lit(0.2, 1.0)
    gloss = fitted_specular(replace(d, shading=3 * np.ones_like(d.shading)))
    assert gloss.specular == pytest.approx(2 / (3 * np.pi), rel=0.05)


def test_both_lobes_of_a_recovered_scene_have_the_same_level() -> None:
    """The convention of the strength differs by f0, the picture that it stands for does not."""
    d = lit(0.2, 1.0)
    models: tuple[LobeModel, LobeModel] = ("ggx", "blinn_phong")
    fits = [
        fit_lobe(
            d.specular,
            d.normal,
            d.mask,
            options=LobeFitOptions(model),
            recovered=RecoveredScene(d.shading),
        )
        for model in models
    ]
    assert fits[0].predicted.max() == pytest.approx(
        fits[1].predicted.max(), rel=0.25
    )  # the two forms differ where lobes are wide
    levels = [fitted_specular(replace(d, brdf=fit)).specular for fit in fits]
    assert levels[0] == pytest.approx(levels[1])
    assert levels[0] == pytest.approx(1.0, rel=0.7)


def test_a_matt_object_has_no_gloss() -> None:
    d = ball()
    gloss = fitted_specular(replace(d, brdf=fit_lobe(0 * d.specular, d.normal, d.mask)))
    assert (gloss.roughness, gloss.specular) == (None, 0.0)
    assert (gloss.roughness_source, gloss.specular_source) == (
        SpecularSource.NOT_FITTED,
        SpecularSource.NO_HIGHLIGHTS,
    )


def test_without_a_fit_nothing_is_said() -> None:
    assert (fitted_specular(ball()).roughness, fitted_specular(ball()).specular) == (None, None)


@pytest.mark.slow
def test_an_upper_bound_is_called_one() -> None:
    d = lit(0.2, 1.0)
    assert d.brdf is not None
    narrow = replace(
        d.brdf, outcome=LobeFitOutcome.NARROW, alpha=0.01, alpha_interval=Interval(0.004, 0.01)
    )
    gloss = fitted_specular(replace(d, brdf=narrow))
    assert gloss.roughness == pytest.approx(0.1)
    assert (gloss.roughness_source, gloss.specular) == (
        SpecularSource.UPPER_BOUND,
        fitted_specular(d).specular,
    )
    unknown: LobeFit = replace(narrow, alpha=None, alpha_interval=None)
    assert fitted_specular(replace(d, brdf=unknown)).roughness_source == SpecularSource.NOT_FITTED


def test_gloss_that_differs_between_paints_becomes_a_texture() -> None:
    d = ball()
    chequered = (np.indices(d.mask.shape) // 16).sum(0) % 2 == 0
    d = lit(0.5, np.where(chequered, 1.0, 0.4))
    found = specular_variation(d)
    assert found is not None
    assert found.min() >= 0
    lit_well = d.brdf is not None and d.brdf.predicted[..., 0] > 0.3 * d.brdf.predicted.max()
    glossy, dull = (np.median(found[lit_well & side]) for side in (chequered, ~chequered))
    assert dull / glossy == pytest.approx(0.4, abs=0.15)


@pytest.mark.parametrize("alpha", [0.1, 0.6])
def test_even_gloss_has_no_texture(alpha: float) -> None:
    """Neither where the lobe covers the object, noise included, nor where a small highlight says
    nothing of the rest.
    """
    d = lit(alpha, 1.0)
    noise = np.random.default_rng(0).normal(0, 0.05, d.mask.shape)[..., None] * d.specular
    assert specular_variation(replace(d, specular=np.maximum(d.specular + noise, 0))) is None
    assert specular_variation(ball()) is None
