"""Small lights: one or two point or directional lights, usually with a little ambient light.

Equation: see `synth.scene.lights`; an irradiance of pi gives a white diffuse surface that faces the
light the radiance 1.

Limits: the lights have no size: shadows are hard, and highlights as wide as the specular lobe.
"""

import numpy as np

from ..scene.lights import DirectionalLight, Light, PointLight
from .placing import perhaps_ambient, places, white

_NEAR, _FAR = 2.5, 6.0


def directional_lights(rng: np.random.Generator) -> tuple[Light, ...]:
    """Draw one or two directional lights, and ambient light in three of four draws.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    tuple of Light
        The directional lights, then the ambient light.
    """
    lights = tuple(
        DirectionalLight(place, np.pi * strength * white(rng)) for place, strength in places(rng)
    )
    return lights + perhaps_ambient(rng)


def point_lights(rng: np.random.Generator) -> tuple[Light, ...]:
    """Draw one or two point lights, 2.5 to 6 object units from the origin.

    Ambient light is added in three of four draws.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    tuple of Light
        The point lights, then the ambient light.
    """
    lights = []
    for place, strength in places(rng):
        distance = rng.uniform(_NEAR, _FAR)
        lights.append(PointLight(distance * place, np.pi * strength * distance**2 * white(rng)))
    return (*lights, *perhaps_ambient(rng))
