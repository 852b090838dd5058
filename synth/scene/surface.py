"""The visible surface of an object: a point, a normal and a reflectance for each pixel.

Position and normal come from the single ray through each pixel's centre, so that nothing is
averaged over an edge and the ground truth is exact. Reflectance is averaged over the pixel's
footprint, as in a camera, so that prints are antialiased.

Limits: visibility is determined only at the centre: silhouettes are not antialiased.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.errors import InputError

from .materials import SurfaceReflectance
from .scene import Scene
from .tracing import Tracer

_FOOTPRINT = 3  # rays per side of a pixel, for its reflectance
_SAME_PLACE = 3.0  # pixels: farther from the centre's hit, a ray of the footprint does not count


@dataclass(frozen=True, eq=False)
class Surface:
    """The N visible points, in row order of `mask`.

    Attributes
    ----------
    mask : (H, W) ndarray of bool
        The object.
    position : (N, 3) ndarray
        Object units.
    normal, view : (N, 3) ndarray
        Unit normals toward the viewer, and unit directions toward the camera.
    uv : (N, 2) ndarray
        Texture coordinates.
    reflectance : SurfaceReflectance
        The material; `albedo` and `strength` averaged over the pixel, `gloss` at its centre.
    """

    mask: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    view: np.ndarray
    uv: np.ndarray
    reflectance: SurfaceReflectance

    def image(self, values: np.ndarray, outside: tuple[float, ...] | float = 0.0) -> np.ndarray:
        """Arrange values of the points as an image.

        Parameters
        ----------
        values : (N,) or (N, C) ndarray
            One value per point.
        outside : tuple of float or float, optional
            Value outside the mask.

        Returns
        -------
        (H, W) or (H, W, C) ndarray of float32
            The image.
        """
        picture = np.empty((*self.mask.shape, *values.shape[1:]), np.float32)
        picture[...] = outside
        picture[self.mask] = values
        return picture


def find_surface(scene: Scene, tracer: Tracer) -> Surface:
    """Return the surface that a scene's camera sees.

    Parameters
    ----------
    scene : Scene
        The scene.
    tracer : Tracer
        Its object.

    Returns
    -------
    Surface
        The visible points.

    Raises
    ------
    InputError
        If the object is not in view.
    """
    origins, directions = (part.reshape(-1, 3) for part in scene.camera.rays())
    hits = tracer.hits(origins, directions)
    if not hits.valid.any():
        raise InputError("the object is not in view: its mask would be empty")
    mask = hits.valid.reshape(scene.camera.height, scene.camera.width)
    position, uv = hits.position[hits.valid], hits.uv[hits.valid]
    reflectance = _footprint_reflectance(scene, tracer, mask, position, uv)
    return Surface(
        mask, position, hits.normal[hits.valid], -directions[hits.valid], uv, reflectance
    )


def _footprint_reflectance(
    scene: Scene, tracer: Tracer, mask: np.ndarray, position: np.ndarray, uv: np.ndarray
) -> SurfaceReflectance:
    centre = scene.material.at(uv)
    if scene.material.albedo.shape[:2] == (1, 1) and np.ndim(scene.material.strength) == 0:
        return centre
    albedo, strength = np.zeros_like(centre.albedo), np.zeros_like(centre.strength)
    steps = (np.arange(_FOOTPRINT) + 0.5) / _FOOTPRINT
    near = _SAME_PLACE / scene.camera.pixels_per_unit
    for down in steps:
        for across in steps:
            origins, directions = (part[mask] for part in scene.camera.rays(across, down))
            hits = tracer.hits(origins, directions)
            same = hits.valid & (np.linalg.norm(hits.position - position, axis=1) < near)
            found = scene.material.at(np.where(same[:, None], hits.uv, uv))
            albedo += found.albedo
            strength += found.strength
    return SurfaceReflectance(albedo / _FOOTPRINT**2, strength / _FOOTPRINT**2, centre.gloss)
