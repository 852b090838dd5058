"""Balls under lights: what a light looks like to a person (thesis, figure 4.49).

Equation: a white matt ball of radius 1 has the normal (x, y, sqrt(1 - x^2 - y^2)); its radiance is
the light's shading of that normal, and a lobe's on top where one is given.
"""

import numpy as np

from ..lobe_fitting.light_direction import lobe_light
from ..shading.lights import DirectionalLight


def sphere_normals(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Normals (size, size, 3) of a ball that fills 90 % of a square picture, and how much of each
    pixel it covers, (size, size).
    """
    radius = 0.45 * size
    axis = (np.arange(size) + 0.5 - size / 2) / radius
    x, y = np.meshgrid(axis, -axis)
    distance = np.hypot(x, y)
    shrink = np.minimum(
        1, 1 / np.maximum(distance, 1e-9)
    )  # beyond the outline its normal, for the pixels that it crosses
    normal = np.stack([x * shrink, y * shrink, np.sqrt(np.maximum(0, 1 - distance**2))], -1)
    return normal, np.clip((1 - distance) * radius + 0.5, 0, 1)


def render_sphere(
    light: DirectionalLight,
    size: int = 320,
    exponent: float | None = None,
    strength: float = 0.1,
    albedo: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """A ball of reflectance `albedo` under `light`, (size, size, 3) linear, and its coverage;
    glossy if `exponent` is given.
    """
    normal, coverage = sphere_normals(size)
    color = albedo * light.shading(normal)
    if exponent is not None:
        color = (
            color
            + strength * lobe_light(normal, light.direction, exponent)[..., None] * light.irradiance
        )
    return color, coverage
