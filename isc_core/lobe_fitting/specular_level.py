"""Roughness and specular level of the fitted lobe in the parameters of renderers, and the spatial
variation of the level.

Problem: a photo determines the product of a lobe's strength and its light. The diffuse shading
contains the same lamp: the lamp's share of the shading gives its irradiance, and hence the
strength.

Equation: S(n) = a max(0, n . l) + b is fitted to the shading, l being the fit's brightest light, a,
b >= 0. Under a lamp of irradiance E, a white Lambertian surface has the radiance E / pi max(0, n .
l), so E = pi a and level = strength x light / E, for a base colour equal to the reflectance. 1 is
the specular reflection of plastic, f0 = .04; Blinn-Phong's strength, which contains f0, is divided
by .04. Where a is less than a third of the brightest shading, the shading does not show the lamp
(recovered lights are smooth, and directions wrong by tens of degrees): the brightest shading then
replaces a.

Variation: t(x) = sum w p s / sum w p^2 around x, s the specular image, p the predicted one. It is
used where the fit explains most of the specular image, p is bright on a quarter of the object, and
t from every second block of pixels explains the other blocks clearly better than one level does.

Citation: glTF's extension KHR_materials_specular, Khronos Group 2021 (no DOI). M. Stone,
"Cross-validatory choice and assessment of statistical predictions", JRSS B 36 (1974),
doi:10.1111/j.2517-6161.1974.tb00994.x.

Limits: a lamp that the shading does not show leaves the level uncertain by a factor of 3. A lobe of
the wrong form, or wrong normals, causes variation too.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ..filters.gaussian import gaussian_average
from ..imaging.channels import channel_means
from ..numerics.linear import nonnegative_pair
from ..scene.decomposition import Decomposition
from ..scene.lobe_fit import LobeFit, LobeFitOutcome
from ..shading.brdf.ggx import F0

_BRIGHTEST_SHADING = 97.0  # percentile
_MIN_LAMP = 1 / 3  # of it: a weaker lamp cannot be detected
_MAX_LEVEL = 1 / F0  # a level that reflects all light
_BLOCK = 0.03  # of the object's diagonal
_COVERED, _BRIGHT, _EXPLAINED, _GAIN = 0.25, 0.1, 0.6, 0.3
_UNIFORM = 0.01  # of the squared specular light: a smaller residual means a uniform level


class SpecularSource(StrEnum):
    """Source of a roughness or a specular level.

    Attributes
    ----------
    FITTED
        The fit.
    LOWERED
        The fit, lowered to the upper bound that the photo implies.
    UPPER_BOUND
        The fit gives an upper bound only.
    NO_HIGHLIGHTS
        There are no highlights.
    NOT_FITTED
        Unknown.
    GIVEN
        The user.
    """

    FITTED = "fitted"
    LOWERED = "lowered to the upper bound"
    UPPER_BOUND = "upper bound"
    NO_HIGHLIGHTS = "no highlights"
    NOT_FITTED = "not fitted"
    GIVEN = "given"


@dataclass(frozen=True, eq=False)
class SpecularFit:
    """Specular parameters of a renderer; None where unknown.

    Attributes
    ----------
    roughness : float or None
        Of glTF and of Blender's Principled BSDF, in [0, 1].
    specular : float or None
        Level >= 0 for a base colour equal to the reflectance; 1 is plastic.
    roughness_source, specular_source : SpecularSource
        Their sources.
    variation : (H, W) ndarray or None
        Factor >= 0 of `specular`; None where one level explains the photo as well.
    """

    roughness: float | None = None
    specular: float | None = None
    roughness_source: SpecularSource = SpecularSource.NOT_FITTED
    specular_source: SpecularSource = SpecularSource.NOT_FITTED
    variation: np.ndarray | None = None


def fitted_specular(d: Decomposition) -> SpecularFit:
    """Convert a decomposition's lobe fit to the parameters of a renderer.

    Parameters
    ----------
    d : Decomposition
        The decomposition.

    Returns
    -------
    SpecularFit
        Unknown where there is no fit.
    """
    fit = d.brdf
    if fit is None:
        return SpecularFit()
    if fit.outcome == LobeFitOutcome.NO_SPECULAR:
        return SpecularFit(specular=0.0, specular_source=SpecularSource.NO_HIGHLIGHTS)
    if fit.blender_roughness is None:
        return SpecularFit()
    level = _level(d, fit)
    source = SpecularSource.NOT_FITTED if level is None else SpecularSource.FITTED
    if not fit.determined:
        return SpecularFit(fit.blender_roughness, level, SpecularSource.UPPER_BOUND, source)
    return SpecularFit(
        fit.blender_roughness,
        level,
        SpecularSource.FITTED,
        source,
        None if level is None else specular_variation(d),
    )


def specular_variation(d: Decomposition) -> np.ndarray | None:
    """Estimate where the specular level varies.

    Parameters
    ----------
    d : Decomposition
        The decomposition.

    Returns
    -------
    (H, W) ndarray or None
        t >= 0, 1 where unknown; None where a single level explains the photo as well.
    """
    if d.brdf is None or d.brdf.explained < _EXPLAINED:
        return None
    predicted, specular = (layer.mean(-1, dtype=float) for layer in (d.brdf.predicted, d.specular))
    usable = d.mask & (d.residual == 0).all(-1) & (predicted > _BRIGHT * predicted.max())
    if usable.sum() < _COVERED * d.mask.sum():
        return None
    rows, columns = np.nonzero(d.mask)
    block = max(3, round(_BLOCK * float(np.hypot(np.ptp(rows), np.ptp(columns)))))
    even = (np.indices(d.mask.shape) // block).sum(0) % 2 == 0
    residual = [0.0, 0.0]
    for known, held_out in ((usable & even, usable & ~even), (usable & ~even, usable & even)):
        local, everywhere = (
            _ratio(specular, predicted, known, block),
            _constant(specular, predicted, known),
        )
        for k, factor in enumerate((local[held_out], everywhere)):
            residual[k] += float(np.square(specular[held_out] - factor * predicted[held_out]).sum())
    if (
        residual[1] < _UNIFORM * np.square(specular[usable]).sum()
        or residual[0] > (1 - _GAIN) * residual[1]
    ):
        return None
    return _ratio(specular, predicted, usable, block)


def lamp_shading(d: Decomposition, direction: np.ndarray) -> float:
    """Return the shading of a surface that faces a lamp.

    Parameters
    ----------
    d : Decomposition
        The decomposition.
    direction : (3,) ndarray
        Unit vector toward the lamp.

    Returns
    -------
    float
        a above, or the brightest shading where the shading does not show the lamp.
    """
    facing = np.maximum(d.normal[d.mask].astype(float) @ direction, 0)
    shading = channel_means(d.shading, d.mask)
    lamp, _ = nonnegative_pair(facing, np.ones_like(facing), shading)
    brightest = float(np.percentile(shading, _BRIGHTEST_SHADING))
    return float(lamp) if lamp > _MIN_LAMP * brightest else brightest


def _level(d: Decomposition, fit: LobeFit) -> float | None:
    if fit.direction is None or fit.strength_light is None:
        return None
    level = float(fit.strength_light.mean()) / (np.pi * lamp_shading(d, fit.direction))
    return min(level / F0 if fit.model.startswith("blinn_phong") else level, _MAX_LEVEL)


def _constant(specular: np.ndarray, predicted: np.ndarray, known: np.ndarray) -> float:
    return float(
        specular[known] @ predicted[known] / max(float(np.square(predicted[known]).sum()), 1e-30)
    )


def _ratio(
    specular: np.ndarray, predicted: np.ndarray, known: np.ndarray, block: int
) -> np.ndarray:
    """t (H, W) from the `known` pixels nearby, regularised toward 1 in dark predictions."""
    common, square = (
        gaussian_average(np.where(known, part, 0.0), 0.5 * block, mirrored=False)
        for part in (specular * predicted, predicted**2)
    )
    ridge = 0.02 * float(square.max())
    return (common + ridge) / (square + ridge) if ridge > 0 else np.ones(specular.shape)
