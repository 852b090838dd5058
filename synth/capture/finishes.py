"""Random finishes: materials from eggshell paint to glaze.

Equation: the exponent p is log-uniform over `EXPONENTS`; alpha of facets is that of the nearest
lobe (`isc_core.shading.brdf.roughness`): .028 to .44. Strength of blinn_phong: log-uniform over
`STRENGTHS`, about the specular share of the light; dielectrics have .02 to .08 at normal incidence
and more toward grazing angles, which that model does not have. Strength of ggx: .6 (worn) to 1.5
(coated twice), ior 1.3 to 1.8. A varying gloss is one of: worn (diffuse where it is worn), smudged
(broader within smudges), striped (diffuse bands).

Citation: A. Ngan, F. Durand, W. Matusik, "Experimental analysis of BRDF models", EGSR 2005,
117-126, doi:10.2312/EGWR/EGSR05/117-126 (measured materials fitted with such lobes).

Limits: gloss varies independently of the albedo's pattern. On a white albedo the strongest draws
reflect more light than they receive, by up to a tenth (blinn_phong) or toward grazing angles (ggx),
as sums of lobes in `scene.materials` may.
"""

from dataclasses import replace
from typing import cast

import numpy as np

from isc_core.errors import InputError
from isc_core.shading.brdf.roughness import fitted_alpha, fitted_exponent

from ..albedos.fields import fractal_noise, grid, smooth_noise, step
from ..scene.materials import DIFFUSE_MODELS, MODELS, Material, Model

FINISHES: tuple[str, ...] = MODELS
VARYING: tuple[str, ...] = ("blinn_phong", "ggx")
EXPONENTS = (5.0, 2000.0)
STRENGTHS = (0.02, 0.15)
FACET_STRENGTHS = (0.6, 1.5)
BROAD_BELOW, SHARP_ABOVE = 30.0, 300.0
_CHANCE = 0.25  # probability of a varying gloss by default
_TEXELS = 256
_WIDEST = 0.5  # the largest alpha that has an exponent


def make_material(
    model: str, albedo: np.ndarray, rng: np.random.Generator, varying: bool | None = None
) -> Material:
    """Draw a material.

    Parameters
    ----------
    model : str
        One of `FINISHES`.
    albedo : (h, w, 3) ndarray
        Its albedo.
    rng : numpy.random.Generator
        Random numbers.
    varying : bool, optional
        Whether gloss and strength are (256, 256) textures. By default in one draw out of four, for
        models in `VARYING`.

    Returns
    -------
    Material
        The material.

    Raises
    ------
    InputError
        For an unknown model, an albedo outside [0, 1], or varying gloss of another model.
    """
    if model not in FINISHES:
        raise InputError(f"unknown material {model!r}: choose {', '.join(FINISHES)}")
    if varying and model not in VARYING:
        raise InputError(
            f"the gloss of {model} cannot vary over the object: choose {' or '.join(VARYING)}"
        )
    varied_by_chance = bool(rng.random() < _CHANCE)
    exponent = _log_uniform(rng, *EXPONENTS)
    if model in DIFFUSE_MODELS:
        return Material(albedo, cast(Model, model), sigma=float(rng.uniform(0.1, 0.6)))
    if model == "blinn_phong":
        material = Material(albedo, "blinn_phong", exponent, _log_uniform(rng, *STRENGTHS))
    else:
        strength = float(rng.uniform(*FACET_STRENGTHS)) if model == "ggx" else 1.0
        material = Material(
            albedo,
            cast(Model, model),
            float(fitted_alpha(exponent)),
            strength,
            float(rng.uniform(1.3, 1.8)),
        )
    if model in VARYING and (varied_by_chance if varying is None else varying):
        return _varied(material, exponent, rng)
    return material


def gloss_class(material: Material) -> str:
    """Classify a material by the median of its exponent.

    Parameters
    ----------
    material : Material
        The material.

    Returns
    -------
    str
        "diffuse", "broad" (exponent below 30), "medium" or "sharp" (above 300).
    """
    if material.is_diffuse or not np.any(material.strength):
        return "diffuse"
    gloss = float(np.median(material.gloss))
    exponent = (
        gloss if material.model == "blinn_phong" else float(fitted_exponent(min(gloss, _WIDEST)))
    )
    return "broad" if exponent < BROAD_BELOW else "sharp" if exponent > SHARP_ABOVE else "medium"


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _varied(material: Material, exponent: float, rng: np.random.Generator) -> Material:
    """The material with textures: the original gloss where the pattern is 0, a broader and weaker
    one where it is 1.
    """
    pattern = (_worn, _smudged, _striped)[rng.integers(3)](rng)
    broader, weaker = rng.uniform(3, 12), rng.uniform(0.1, 0.6)
    exponents = np.maximum(exponent * broader**-pattern, EXPONENTS[0])
    gloss = exponents if material.model == "blinn_phong" else fitted_alpha(exponents)
    return replace(material, gloss=gloss, strength=material.strength * (1 - (1 - weaker) * pattern))


def _worn(rng: np.random.Generator) -> np.ndarray:
    """Large worn areas with ragged edges, (256, 256) in [0, 1]."""
    field = smooth_noise(rng, _TEXELS, rng.uniform(1.5, 3)) + 0.4 * fractal_noise(rng, _TEXELS, 2)
    return step(field - rng.uniform(-0.2, 0.8), 0.5)


def _smudged(rng: np.random.Generator) -> np.ndarray:
    """Wiped smudges, longer than wide, (256, 256) in [0, 1]."""
    field = smooth_noise(rng, _TEXELS, rng.uniform(6, 10), rng.uniform(1.5, 4))
    return rng.uniform(0.5, 1) * step(field - rng.uniform(0.3, 0.9), 0.8)


def _striped(rng: np.random.Generator) -> np.ndarray:
    """Rings, upright stripes or screws, (256, 256) in [0, 1]."""
    u, v = grid(_TEXELS)
    count, turns = rng.integers(3, 9), rng.integers(0, 2)
    phase = count * v + turns * u if rng.random() < 0.6 else count * u
    return step(0.25 - np.abs(np.mod(phase, 1) - 0.5), 0.04)
