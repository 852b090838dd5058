"""Rendered spheres that visualise a light (thesis, figure 4.49).

Equation: a white diffuse sphere of radius 1 has the normal (x, y, sqrt(1 - x^2 - y^2)); its
radiance is the light's shading of that normal, plus that of a lobe if one is given.
"""

import numpy as np

from ..lobe_fitting.light_direction import lobe_light
from ..shading.lights import DirectionalLight


def sphere_normals(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the normals and coverage of a sphere that fills 90 % of a square picture.

    Parameters
    ----------
    size : int

    Returns
    -------
    normal : (size, size, 3) ndarray
    coverage : (size, size) ndarray
        In [0, 1].
    """
    radius = 0.45 * size
    axis = (np.arange(size) + 0.5 - size / 2) / radius
    x, y = np.meshgrid(axis, -axis)
    distance = np.hypot(x, y)
    shrink = np.minimum(
        1, 1 / np.maximum(distance, 1e-9)
    )  # outside the outline: the normal at the outline, for partly covered pixels
    normal = np.stack([x * shrink, y * shrink, np.sqrt(np.maximum(0, 1 - distance**2))], -1)
    return normal, np.clip((1 - distance) * radius + 0.5, 0, 1)


def render_sphere(
    light: DirectionalLight,
    size: int = 320,
    exponent: float | None = None,
    strength: float = 0.1,
    albedo: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Render a sphere under a light.

    Parameters
    ----------
    light : DirectionalLight
    size : int
        In pixels.
    exponent : float, optional
        Blinn-Phong exponent of a lobe.
    strength : float
        Of the lobe.
    albedo : float

    Returns
    -------
    image : (size, size, 3) ndarray
        Linear.
    coverage : (size, size) ndarray
    """
    normal, coverage = sphere_normals(size)
    color = albedo * light.shading(normal)
    if exponent is not None:
        color = (
            color
            + strength * lobe_light(normal, light.direction, exponent)[..., None] * light.irradiance
        )
    return color, coverage
