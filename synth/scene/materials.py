"""Reflectance of an object's surface: a coloured diffuse lobe and, on most materials, a white
specular lobe on top.

Equation: f_r = albedo * diffuse + strength * specular, the lobes of `isc_core.shading.brdf` or of
Mitsuba's rough plastic:

    lambert       1 / pi              no specular lobe
    oren_nayar    the rough diffuse lobe of slope deviation `sigma`, no specular lobe
    blinn_phong   1 / pi  +  strength (p + 8) / (8 pi) cos^p     p = gloss, "normalised"
    ggx           1 / pi  +  strength D G F / (4 cos cos)        alpha = gloss, Schlick's F with
                                                                 f0 = ((ior - 1) / (ior + 1))^2
    roughplastic  Mitsuba's, GGX facets: the exact Fresnel term of `ior`, alpha = gloss (uniform),
                  strength 1; its diffuse lobe loses what the interface reflects (`nonlinear` off:
                  it stays proportional to the albedo)

Citation: see the modules of `isc_core.shading.brdf`; W. Jakob et al., Mitsuba 3 renderer, 2022
(rough plastic).

Limits: dielectrics; the specular lobe is white. Textures are sampled bilinearly; u wraps around, v
is clamped.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from isc_core.errors import InputError

Model = Literal["lambert", "oren_nayar", "blinn_phong", "ggx", "roughplastic"]
MODELS: tuple[str, ...] = get_args(Model)
DIFFUSE_MODELS: tuple[str, ...] = ("lambert", "oren_nayar")
_RANGES = {"blinn_phong": (1.0, 10000.0), "ggx": (0.01, 1.0), "roughplastic": (0.01, 1.0)}


@dataclass(frozen=True, eq=False)
class SurfaceReflectance:
    """A material at N points.

    Attributes
    ----------
    albedo : (N, 3) ndarray
        In [0, 1].
    strength, gloss : (N,) ndarray
        Of the specular lobe, see the module; 0 for diffuse models.
    """

    albedo: np.ndarray
    strength: np.ndarray
    gloss: np.ndarray


@dataclass(frozen=True, eq=False)
class Material:
    """A material with its textures.

    Attributes
    ----------
    albedo : (h, w, 3) ndarray
        Linear Rec.709 in [0, 1], row 0 at v = 0, columns along u.
    model : str
        One of `MODELS`.
    gloss : float or (h, w) ndarray
        Exponent of blinn_phong, alpha of ggx and roughplastic (a number for the latter).
    strength : float or (h, w) ndarray
        Of the specular lobe, >= 0 (1 for roughplastic).
    ior : float
        Of ggx and roughplastic, in (1, 3].
    sigma : float
        Of oren_nayar, radians in [0, pi/2].

    Raises
    ------
    InputError
        Outside these ranges.
    """

    albedo: np.ndarray
    model: Model = "blinn_phong"
    gloss: float | np.ndarray = 100.0
    strength: float | np.ndarray = 0.1
    ior: float = 1.5
    sigma: float = 0.3

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise InputError(f"unknown material {self.model!r}: choose {', '.join(MODELS)}")
        albedo = np.asarray(self.albedo)
        if (
            albedo.ndim != 3
            or albedo.shape[2] != 3
            or not albedo.size
            or not ((albedo >= 0) & (albedo <= 1)).all()
        ):
            raise InputError("an albedo must be an (h, w, 3) image with values from 0 to 1")
        if not (1 < self.ior <= 3 and 0 <= self.sigma <= np.pi / 2):
            raise InputError("ior must be above 1 and at most 3, sigma between 0 and pi/2")
        if self.is_diffuse:
            return
        if any(
            np.ndim(values) not in (0, 2) or not np.size(values)
            for values in (self.gloss, self.strength)
        ):
            raise InputError("the gloss and its strength must be numbers or (h, w) textures")
        low, high = _RANGES[self.model]
        if not ((np.asarray(self.gloss) >= low) & (np.asarray(self.gloss) <= high)).all():
            raise InputError(f"the gloss of {self.model} must be from {low:g} to {high:g}")
        if not (np.isfinite(self.strength).all() and (np.asarray(self.strength) >= 0).all()):
            raise InputError("the strength of a gloss must be finite and at least 0")
        if self.model == "roughplastic" and (
            np.ndim(self.gloss) or np.ndim(self.strength) or self.strength != 1
        ):
            raise InputError("roughplastic needs a uniform gloss and strength 1")

    @property
    def is_diffuse(self) -> bool:
        """Whether there is no specular lobe."""
        return self.model in DIFFUSE_MODELS

    @property
    def f0(self) -> float:
        """Reflectance at normal incidence of ggx and roughplastic."""
        return ((self.ior - 1) / (self.ior + 1)) ** 2

    def at(self, uv: np.ndarray) -> SurfaceReflectance:
        """Return the material at texture coordinates.

        Parameters
        ----------
        uv : (N, 2) ndarray
            Coordinates; u wraps around, v is clamped.

        Returns
        -------
        SurfaceReflectance
            One entry per coordinate pair.
        """
        albedo = texture_at(np.asarray(self.albedo, float), uv)
        if self.is_diffuse:
            return SurfaceReflectance(albedo, np.zeros(len(uv)), np.zeros(len(uv)))
        strength, gloss = (
            texture_at(_texture(values), uv) for values in (self.strength, self.gloss)
        )
        return SurfaceReflectance(albedo, strength, gloss)


def texture_at(texture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Sample a texture bilinearly between texel centres.

    Parameters
    ----------
    texture : (h, w) or (h, w, C) ndarray
        The texture.
    uv : (N, 2) ndarray
        Coordinates; u wraps around, v is clamped.

    Returns
    -------
    (N,) or (N, C) ndarray
        The values.
    """
    rows, columns = texture.shape[:2]
    x, y = uv[:, 0] * columns - 0.5, np.clip(uv[:, 1] * rows - 0.5, 0, rows - 1)
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right_share, low_share = x - left, y - top
    low = np.minimum(top + 1, rows - 1)
    left, right = left % columns, (left + 1) % columns
    if texture.ndim == 3:
        right_share, low_share = right_share[:, None], low_share[:, None]
    upper = texture[top, left] * (1 - right_share) + texture[top, right] * right_share
    lower = texture[low, left] * (1 - right_share) + texture[low, right] * right_share
    return upper * (1 - low_share) + lower * low_share


def _texture(values: float | np.ndarray) -> np.ndarray:
    """A number as a texture of one texel; a texture unchanged."""
    return np.atleast_2d(np.asarray(values, float))
