"""Outgoing radiance of surfaces under lights.

Problem: the image of normals with a known reflectance.

Equation: radiance_c = sum_k f_r,c(normal, view, light_k) max(0, normal . light_k) irradiance_kc,
over distant lights; light k arrives with `irradiance_k` on a plane across its beam. A sample of an
environment with the solid angle w (sr) and radiance R is such a light with the irradiance w R. The
recovered light is none of these: it is the shading itself, exp(sum_k L_kc Y_k(normal)), and
radiance = reflectance * shading for Lambertian surfaces.

Citation: F. E. Nicodemus et al., "Geometrical considerations and nomenclature for reflectance", NBS
Monograph 160 (1977), doi:10.6028/NBS.MONO.160. R. Ramamoorthi and P. Hanrahan, "An efficient
representation for irradiance environment maps", SIGGRAPH 2001, doi:10.1145/383259.383317.

Limits: no cast shadows, no interreflection. Samples of an environment must be denser than the lobe
is wide.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .brdf.directions import unit
from .brdf.model import Model, check_range
from .spherical_harmonics import real_sh

_MOST_VALUES = 1 << 16  # of the model at a time, unless one light has more


@dataclass(frozen=True, eq=False)
class DistantLights:
    """K distant lights.

    Attributes
    ----------
    directions : (K, 3) ndarray
        Unit vectors toward the lights, K >= 1.
    irradiance : (K, 3) ndarray
        Of each on a plane across its beam, >= 0.

    Raises
    ------
    InputError
        For other shapes or values.
    """

    directions: np.ndarray
    irradiance: np.ndarray

    def __post_init__(self) -> None:
        unit(self.directions, "directions")
        shapes = np.shape(self.directions), np.shape(self.irradiance)
        if shapes[0] != shapes[1] or len(shapes[0]) != 2 or not shapes[0][0]:
            raise InputError(
                f"directions {shapes[0]} and irradiance {shapes[1]} have to be (K, 3)"
                " with the same K >= 1"
            )
        check_range("irradiance", self.irradiance, 0, np.inf)


def directional(direction: np.ndarray, irradiance: np.ndarray | float = np.pi) -> DistantLights:
    """Return one distant light.

    Parameters
    ----------
    direction : (3,) ndarray
        Unit vector toward the light.
    irradiance : float or (3,) ndarray
        >= 0; at pi a white Lambertian surface that faces the light has radiance 1.

    Returns
    -------
    DistantLights

    Raises
    ------
    InputError
        For other values.
    """
    return DistantLights(
        np.reshape(direction, (1, -1)), np.broadcast_to(np.asarray(irradiance, float), (1, 3))
    )


def environment(directions: np.ndarray, weights: np.ndarray, radiance: np.ndarray) -> DistantLights:
    """Return the samples of an environment as lights.

    Parameters
    ----------
    directions : (K, 3) ndarray
        Unit vectors.
    weights : (K,) ndarray
        Solid angles in sr, >= 0.
    radiance : (K, 3) ndarray
        >= 0.

    Returns
    -------
    DistantLights

    Raises
    ------
    InputError
        For other shapes or values.
    """
    if np.shape(radiance) != (*np.shape(weights), 3):
        raise InputError(
            f"weights {np.shape(weights)} and radiance {np.shape(radiance)}"
            " have to be (K,) and (K, 3)"
        )
    check_range("weights", weights, 0, np.inf)
    return DistantLights(
        np.asarray(directions, float), np.asarray(weights, float)[:, None] * radiance
    )


def radiance(
    model: Model, normal: np.ndarray, view: np.ndarray, lights: DistantLights
) -> np.ndarray:
    """Compute the radiance that leaves surfaces toward the viewer.

    Parameters
    ----------
    model : Model
    normal : (..., 3) ndarray
        Unit normals.
    view : (3,) or (..., 3) ndarray
        Unit vectors toward the viewer.
    lights : DistantLights

    Returns
    -------
    (..., 3) ndarray
        In the unit of irradiance per sr, >= 0.

    Raises
    ------
    InputError
        If a vector does not have length 1.
    """
    normal, directions = unit(normal, "normal"), unit(lights.directions, "directions")
    total = np.zeros(np.broadcast_shapes(normal.shape, np.shape(view)))
    count = max(1, _MOST_VALUES // max(1, total.size // 3))
    for first in range(0, len(directions), count):
        some = slice(first, first + count)
        toward = directions[some].reshape(-1, *[1] * (total.ndim - 1), 3)
        reflected = model.value(normal, view, toward)
        if reflected.ndim == total.ndim:
            reflected = reflected[..., None]
        for one, direction, irradiance in zip(
            reflected, directions[some], lights.irradiance[some], strict=True
        ):
            total += one * np.maximum(normal @ direction, 0)[..., None] * irradiance
    return total


def sh_shading(normal: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Compute the shading exp(sum_k L_kc Y_k(normal)) of a recovered light.

    It is the radiance of a Lambertian surface of albedo 1.

    Parameters
    ----------
    normal : (..., 3) ndarray
        Unit normals, camera frame.
    coefficients : (9, 3) ndarray
        L, in the order of `spherical_harmonics.real_sh`.

    Returns
    -------
    (..., 3) ndarray

    Raises
    ------
    InputError
        If the coefficients have another shape, are not finite, or are too large.
    """
    if np.shape(coefficients) != (9, 3) or not np.isfinite(coefficients).all():
        raise InputError(
            f"coefficients have shape {np.shape(coefficients)}: give (9, 3) finite numbers"
        )
    log_shading = real_sh(unit(normal, "normal")) @ np.asarray(coefficients, float)
    if log_shading.size and log_shading.max() > np.log(np.finfo(float).max):
        raise InputError(
            "the light overflows: its coefficients have to be of the shading's logarithm"
        )
    return np.exp(log_shading)
