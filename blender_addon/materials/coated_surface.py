"""The surface of an object under its specular layer, from a result or from data in a .blend file.

Problem: the base colour under gloss (`isc_core.lobe_fitting.specular_layer`) has to follow when the
gloss is edited, as if the fit had found that gloss. The file no longer contains the result.

Equation: normals are codes of 8 bits; the shading is exp(SH(n)) of the light's coefficients, which
are kept as numbers with the environment and the camera.

Citation: none.

Limits: shading that does not depend on the normal alone, as after `isc refine --light`, is treated
as if it did.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isc_core.lobe_fitting.specular_layer import ENVIRONMENT_ROWS, CoatedSurface
from isc_core.photo.camera import Camera
from isc_core.shading.environment_map import resampled
from isc_core.shading.lights import VIEW
from isc_core.shading.perspective import view_directions
from isc_core.shading.spherical_harmonics import real_sh

from ..files.result_arrays import ResultArrays

_COEFFICIENTS = 27  # of the illumination


@dataclass(frozen=True, eq=False)
class RecoveredLight:
    """The part of the recovered light that a specular layer needs.

    Attributes
    ----------
    environment : (rows, 2 rows, 3) ndarray
        Radiance, see `isc_core.shading.environment_map`.
    illumination : (9, 3) ndarray
        Log-shading SH coefficients for the base colour.
    camera : Camera or None
        The photo's, of the maps; None for an orthographic view.
    """

    environment: np.ndarray
    illumination: np.ndarray
    camera: Camera | None

    def view(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the unit vectors toward the viewer.

        Parameters
        ----------
        shape : tuple of int
            (H, W) of the maps.

        Returns
        -------
        (3,) or (H, W, 3) ndarray
        """
        if self.camera is None:
            return VIEW
        return view_directions(self.camera, (shape[0], shape[1]))

    @property
    def numbers(self) -> list[float]:
        """The same as a list of numbers, which a datablock can store."""
        camera = self.camera
        place = [0.0, 0, 0] if camera is None else [camera.focal_length, *camera.principal_point]
        return [*place, *self.illumination.ravel().tolist(), *self.environment.ravel().tolist()]


def light_from_numbers(numbers: Sequence[float]) -> RecoveredLight:
    """Return the light of `RecoveredLight.numbers`.

    Parameters
    ----------
    numbers : sequence of float

    Returns
    -------
    RecoveredLight
    """
    values = np.array(numbers, float)
    (focal_length, x, y), illumination, environment = np.split(values, (3, 3 + _COEFFICIENTS))
    rows = round((len(environment) / 6) ** 0.5)
    return RecoveredLight(
        environment.reshape(rows, 2 * rows, 3),
        illumination.reshape(9, 3),
        Camera(float(focal_length), (float(x), float(y))) if focal_length > 0 else None,
    )


def recovered_light(result: ResultArrays) -> RecoveredLight:
    """Return the part of a result's light that a specular layer needs.

    Parameters
    ----------
    result : ResultArrays

    Returns
    -------
    RecoveredLight
    """
    environment = resampled(result.environment_map.astype(float), ENVIRONMENT_ROWS)
    return RecoveredLight(environment, result.mesh_illumination, result.camera)


def coated_surface(result: ResultArrays) -> CoatedSurface:
    """Return the surface of a result.

    Parameters
    ----------
    result : ResultArrays

    Returns
    -------
    CoatedSurface
    """
    variation = result.specular_variation
    light = recovered_light(result)
    return CoatedSurface(
        np.where(result.mask[..., None], result.normal, 0),
        result.shading / result.reflectance_scale,
        light.environment,
        light.view(result.mask.shape),
        None if variation is None else variation / max(1.0, float(variation.max())),
    )


def encode_normals(normal: np.ndarray) -> np.ndarray:
    """Code normals in 8 bits; 0 outside the object, where they are 0.

    Parameters
    ----------
    normal : (H, W, 3) ndarray

    Returns
    -------
    (H, W, 3) ndarray of uint8
    """
    codes = np.rint(127 * normal + 128).astype(np.uint8)
    return np.where(normal.any(-1)[..., None], codes, np.uint8(0))


def surface_from_codes(
    normals: np.ndarray, light: RecoveredLight, variation: np.ndarray | None
) -> CoatedSurface:
    """Return the surface of `encode_normals`, whose shading is that of the light's illumination.

    Parameters
    ----------
    normals : (H, W, 3) ndarray of uint8
    light : RecoveredLight
    variation : (H, W) ndarray of uint8 or None
        Coded factor of the specular level.

    Returns
    -------
    CoatedSurface
    """
    mask = normals.any(-1)
    normal, shading = (np.zeros(normals.shape) for _ in range(2))
    inside = (normals[mask] - 128.0) / 127
    normal[mask] = inside / np.linalg.norm(inside, axis=-1, keepdims=True)
    shading[mask] = np.exp(real_sh(normal[mask]) @ light.illumination)
    factor = None if variation is None else variation / 255
    return CoatedSurface(normal, shading, light.environment, light.view(mask.shape), factor)
