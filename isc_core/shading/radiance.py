"""Outgoing radiance of surfaces under lights.

Problem: what a camera sees of normals with a known reflectance.

Equation: radiance_c = sum_k f_r,c(normal, view, light_k) max(0, normal . light_k) irradiance_kc,
over lights that are far away; light k arrives with `irradiance_k` on a plane across its beam. A
sample of an environment that stands for a solid angle w (sr) with radiance R is such a light with
the irradiance w R. Our own light is none of these: it is the shading itself, exp(sum_k L_kc
Y_k(normal)), and radiance = reflectance * shading for matt surfaces.

Citation: F. E. Nicodemus et al., "Geometrical considerations and nomenclature for reflectance", NBS
Monograph 160 (1977), doi:10.6028/NBS.MONO.160. R. Ramamoorthi and P. Hanrahan, "An efficient
representation for irradiance environment maps", SIGGRAPH 2001, doi:10.1145/383259.383317.

Limits: no cast shadows, no light between surfaces. Samples of an environment must be denser than
the lobe is wide.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .brdf.directions import unit
from .brdf.model import Model, check_range
from .spherical_harmonics import real_sh


@dataclass(frozen=True)
class DistantLights:
    """`directions` (K, 3): unit vectors toward the lights, K >= 1. `irradiance` (K, 3): of each on
    a plane across its beam, >= 0. Raises `InputError` for anything else.
    """

    directions: np.ndarray
    irradiance: np.ndarray

    def __post_init__(self) -> None:
        unit(self.directions, "directions")
        shapes = np.shape(self.directions), np.shape(self.irradiance)
        if shapes[0] != shapes[1] or len(shapes[0]) != 2 or not shapes[0][0]:
            raise InputError(
                f"directions {shapes[0]} and irradiance {shapes[1]} have to be (K, 3) with the same K >= 1"
            )
        check_range("irradiance", self.irradiance, 0, np.inf)


def directional(direction: np.ndarray, irradiance: np.ndarray | float = np.pi) -> DistantLights:
    """One light from the unit vector `direction` (3,), irradiance a number or (3,), >= 0. At pi a
    white matt surface that faces it has radiance 1.

    Raises `InputError` for anything else.
    """
    return DistantLights(
        np.reshape(direction, (1, -1)), np.broadcast_to(np.asarray(irradiance, float), (1, 3))
    )


def environment(directions: np.ndarray, weights: np.ndarray, radiance: np.ndarray) -> DistantLights:
    """Samples of an environment: unit vectors `directions` (K, 3), solid angles `weights` (K,) in
    sr, `radiance` (K, 3), both >= 0.

    Raises `InputError` for anything else.
    """
    if np.shape(radiance) != (*np.shape(weights), 3):
        raise InputError(
            f"weights {np.shape(weights)} and radiance {np.shape(radiance)} have to be (K,) and (K, 3)"
        )
    check_range("weights", weights, 0, np.inf)
    return DistantLights(np.asarray(directions, float), np.asarray(weights, float)[:, None] * radiance)


def radiance(model: Model, normal: np.ndarray, view: np.ndarray, lights: DistantLights) -> np.ndarray:
    """What leaves surfaces with `normal` (..., 3) toward `view` (3,) or (..., 3): (..., 3), in the
    unit of irradiance per sr, >= 0.

    Raises `InputError` for vectors that are not of length 1.
    """
    normal = unit(normal, "normal")
    total = np.zeros(np.broadcast_shapes(normal.shape, np.shape(view)))
    for direction, irradiance in zip(
        unit(lights.directions, "directions"), lights.irradiance, strict=True
    ):
        reflected = model.value(normal, view, direction)
        if reflected.ndim < total.ndim:
            reflected = reflected[..., None]
        total += reflected * np.maximum(normal @ direction, 0)[..., None] * irradiance
    return total


def sh_shading(normal: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """exp(sum_k L_kc Y_k(normal)), (..., 3): the radiance of a matt surface of reflectance 1 under
    our light.

    `normal` (..., 3): unit vectors, x right, y up, z toward the viewer. `coefficients` (9, 3): L,
    in the order of `shading.spherical_harmonics.real_sh`. Raises `InputError` for other shapes, and for
    coefficients that are not finite or too large for a number.
    """
    if np.shape(coefficients) != (9, 3) or not np.isfinite(coefficients).all():
        raise InputError(
            f"coefficients have shape {np.shape(coefficients)}: give (9, 3) finite numbers"
        )
    log_shading = real_sh(unit(normal, "normal")) @ np.asarray(coefficients, float)
    if log_shading.size and log_shading.max() > np.log(np.finfo(float).max):
        raise InputError(
            "the light is too bright for a number: its coefficients are of the shading's LOGARITHM"
        )
    return np.exp(log_shading)
