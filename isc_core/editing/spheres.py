"""Rendered spheres that visualise a light (thesis, figure 4.49).

Equation: the radiance of a white diffuse sphere is the light's shading of its normal, plus that of
a lobe if one is given.
"""

import numpy as np

from ..lobe_fitting.light_direction import lobe_light
from ..shading.lights import DirectionalLight
from ..shading.sphere import sphere_normals


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
