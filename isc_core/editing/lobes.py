"""The lobe that an edit renders, and what it sends to the viewer under any of the edits' lights.

Equation: radiance(n) = sum over lights of f_r(n, v, l) max(0, n . l) E, with the viewer along z. It
depends on the normal alone, so under an environment of many samples it is rendered for a table of
normals, in the stereographic plane (x, y) / (1 + z), and looked up there.

Strength: a lobe has none that a photo's unit could tell. It is given relative to the photo
(`level`: how bright the lobe's centre would be at exponent 60, in units of the photo's white; other
exponents keep the energy), or such that the present specular layer's energy stays.

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; B. Walter et al. 2007,
doi:10.2312/EGWR/EGSR07/195-206 (see `brdf`).

Limits: no shadows, no light between parts of the surface.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..brdf.blinn_phong import BlinnPhong
from ..brdf.ggx import Ggx
from ..brdf.model import Model, check_range
from ..brdf.roughness import exponent_from_alpha, fitted_exponent
from ..brdf.shading import Lights, directional, radiance
from ..decomposition import Decomposition
from ..environment import directions, solid_angles
from .edited import MOST_GAIN, luminance, white_of
from .light_direction import VIEW
from .lights import DirectionalLight

USUAL_EXPONENT = 60.0
_FITTED_ALPHA = 0.5  # the largest alpha of `fitted_exponent`
_TABLE = 65  # samples of the stereographic plane along an axis
_TOO_BRIGHT = 2.0  # of the photo's white: kept energy never asks for more at a lobe's centre


@dataclass(frozen=True)
class Lobe:
    """A lobe of strength 1: Blinn-Phong's `exponent` in [1, 1e5], or the `alpha` in [.01, 1] of GGX
    facets, which then counts, and their `f0`, 1 for mirrors.

    Raises `InputError` outside these ranges.
    """

    exponent: float = USUAL_EXPONENT
    alpha: float | None = None
    f0: float = 1.0

    def __post_init__(self) -> None:
        check_range("exponent", self.exponent, 1, 1e5)
        if self.alpha is not None:
            check_range("alpha", self.alpha, 0.01, 1)
            check_range("f0", self.f0, 0, 1)

    @property
    def model(self) -> Model:
        """The reflectance model, without a strength of its own."""
        return BlinnPhong(1.0, self.exponent) if self.alpha is None else Ggx(self.alpha, self.f0)

    @property
    def nearest_exponent(self) -> float:
        """The Blinn-Phong exponent, at least 1, whose lobe is about this one's."""
        if self.alpha is None:
            return self.exponent
        rule = fitted_exponent if self.alpha <= _FITTED_ALPHA else exponent_from_alpha
        return max(float(rule(self.alpha)), 1.0)


def known_lobe(d: Decomposition) -> Lobe | None:
    """The lobe that was fitted to the photo, the widest that it can be where only that is known;
    None where there is no fit or it says nothing of the roughness.
    """
    fit = d.brdf
    if fit is None or fit.alpha is None:
        return None
    alpha = float(np.clip(fit.alpha, 0.01, 1))
    return (
        Lobe(alpha=alpha)
        if fit.model.startswith("ggx")
        else Lobe(float(np.clip(exponent_from_alpha(alpha), 1, 1e5)))
    )


def lobe_under(lobe: Lobe, normal: np.ndarray, light: DirectionalLight) -> np.ndarray:
    """What the lobe sends to the viewer under one light, without its ambient:

    (..., 3) for unit normals (..., 3).
    """
    return radiance(lobe.model, _unit(normal), VIEW, directional(light.direction, light.irradiance))


def lobe_in(lobe: Lobe, normal: np.ndarray, sky: np.ndarray) -> np.ndarray:
    """What the lobe sends to the viewer in an environment (rows, 2 rows, 3), see `environment`:

    (N, 3) for unit normals (N, 3).
    """
    rows = len(sky)
    lit = (sky > 0).any(-1).reshape(-1)
    if not lit.any():
        return np.zeros((len(normal), 3))
    lights = Lights(
        directions(rows).reshape(-1, 3)[lit],
        (solid_angles(rows)[..., None] * sky).reshape(-1, 3)[lit],
    )
    axis = np.linspace(-1.0, 1.0, _TABLE)
    u, v = np.meshgrid(axis, axis, indexing="ij")
    square = np.minimum(
        u * u + v * v, 1
    )  # the corners lie behind the horizon: their normals are not asked for
    shrink = np.sqrt(square / np.maximum(u * u + v * v, 1e-12))
    table_normals = (
        np.stack([2 * u * shrink, 2 * v * shrink, 1 - square], -1) / (1 + square)[..., None]
    )
    table_normals[_TABLE // 2, _TABLE // 2] = VIEW
    table = radiance(lobe.model, _unit(table_normals), VIEW, lights)
    places = (normal[:, :2] / (1 + np.maximum(normal[:, 2:], 0)) + 1) * (_TABLE - 1) / 2
    return np.stack(
        [
            ndimage.map_coordinates(table[..., c], places.T, order=1, mode="nearest")
            for c in range(3)
        ],
        -1,
    )


def strength_of(d: Decomposition, lobe: Lobe, unscaled: np.ndarray, level: float | None) -> float:
    """The factor for `unscaled` (H, W, 3), the lobe of strength 1 as rendered under a light of
    irradiance 1 across its beam.

    `level` in [0, 1e6]: brightness relative to the photo's white, see the module; None keeps the
    energy of the present specular layer, as far as that does not make the lobe's centre brighter
    than twice the white, and is level 1 where there is none. Raises `InputError`.
    """
    if level is not None:
        check_range("strength", level, 0, MOST_GAIN)
    white = white_of(d.image, d.mask)
    unit_level = white / _centre(Lobe())
    present, rendered = luminance(d.specular[d.mask]).sum(), luminance(unscaled[d.mask]).sum()
    if level is None and present > 0 and rendered > 0:
        return float(min(present / rendered, _TOO_BRIGHT * white / _centre(lobe)))
    return unit_level * (1.0 if level is None else level)


def _centre(lobe: Lobe) -> float:
    """The radiance of the lobe's centre, light and view along the normal, irradiance 1."""
    return float(radiance(lobe.model, VIEW, VIEW, directional(VIEW, 1.0))[0])


def _unit(normal: np.ndarray) -> np.ndarray:
    normal = np.asarray(normal, float)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)
