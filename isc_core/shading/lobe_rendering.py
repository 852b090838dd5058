"""A specular lobe, and its radiance toward the viewer under a light or an environment map.

Equation: radiance(n) = sum over lights of f_r(n, v, l) max(0, n . l) E; under an environment map as
`mirrored_environment` states.

Citation: J. F. Blinn 1977, doi:10.1145/563858.563893; B. Walter et al. 2007,
doi:10.2312/EGWR/EGSR07/195-206 (see `brdf`).

Limits: no cast shadows, no interreflection. In an environment the lobe's width and Fresnel's factor
are those of the view along z.
"""

from dataclasses import dataclass, replace

import numpy as np

from .brdf.blinn_phong import BlinnPhong
from .brdf.ggx import Ggx
from .brdf.model import Model, check_range
from .brdf.roughness import exponent_from_alpha, fitted_exponent
from .lights import VIEW, DirectionalLight
from .mirrored_environment import MirroredEnvironment, narrowest_alpha
from .radiance import directional, radiance

DEFAULT_EXPONENT = 60.0

_FITTED_ALPHA = 0.5  # the largest alpha of `fitted_exponent`


@dataclass(frozen=True)
class Lobe:
    """A specular lobe of strength 1.

    Attributes
    ----------
    exponent : float
        Blinn-Phong exponent, in [1, 1e5].
    alpha : float or None
        Width of GGX facets, in [.01, 1]; if given, it replaces the exponent.
    f0 : float
        Reflectance of the facets along the normal, in [0, 1]; 1 for mirrors.

    Raises
    ------
    InputError
        Outside these ranges.
    """

    exponent: float = DEFAULT_EXPONENT
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
        """The Blinn-Phong exponent, at least 1, of the most similar lobe."""
        if self.alpha is None:
            return self.exponent
        rule = fitted_exponent if self.alpha <= _FITTED_ALPHA else exponent_from_alpha
        return max(float(rule(self.alpha)), 1.0)


def lobe_under(
    lobe: Lobe, normal: np.ndarray, light: DirectionalLight, view: np.ndarray = VIEW
) -> np.ndarray:
    """Compute the radiance of the lobe toward the viewer under one light, without its ambient part.

    Parameters
    ----------
    lobe : Lobe
    normal : (..., 3) ndarray
        Unit normals, camera frame.
    light : DirectionalLight
    view : (3,) or (..., 3) ndarray, optional
        Unit vectors toward the viewer.

    Returns
    -------
    (..., 3) ndarray
    """
    return radiance(lobe.model, _unit(normal), view, directional(light.direction, light.irradiance))


def lobe_in_environment(
    lobe: Lobe, normal: np.ndarray, environment: np.ndarray, view: np.ndarray = VIEW
) -> np.ndarray:
    """Compute the radiance of the lobe toward the viewer in an environment.

    A lobe narrower than the pixels of the environment is taken to be as wide as these.

    Parameters
    ----------
    lobe : Lobe
    normal : (N, 3) ndarray
        Unit normals, camera frame.
    environment : (rows, 2 rows, 3) ndarray
        Linear radiance, see `environment_map`.
    view : (3,) or (N, 3) ndarray, optional
        Unit vectors toward the viewer.

    Returns
    -------
    (N, 3) ndarray
    """
    model = _widened(lobe, narrowest_alpha(len(environment))).model
    return MirroredEnvironment(model, environment).toward(normal, view)


def _widened(lobe: Lobe, alpha: float) -> Lobe:
    """The lobe, at least as wide as one of `alpha`."""
    if lobe.alpha is not None:
        return replace(lobe, alpha=max(lobe.alpha, alpha))
    return replace(lobe, exponent=min(lobe.exponent, float(exponent_from_alpha(alpha))))


def _unit(normal: np.ndarray) -> np.ndarray:
    normal = np.asarray(normal, float)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)
