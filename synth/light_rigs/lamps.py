"""Small lights: one or two lamps far away or near by, usually with a little light from all around.

Equation: see `synth.scene.lights`; an irradiance of pi gives a white matt surface that faces the lamp the
radiance 1.

Limits: lamps have no size, so that shadows are hard and highlights as wide as the gloss alone.
"""

import numpy as np

from ..scene.lights import DirectionalLight, Light, PointLight
from .placing import perhaps_ambient, places, white

_NEAR, _FAR = 2.5, 6.0


def directional_lights(rng: np.random.Generator) -> tuple[Light, ...]:
    """One or two lamps infinitely far away, and ambient light in three of four draws."""
    lamps = tuple(
        DirectionalLight(place, np.pi * strength * white(rng)) for place, strength in places(rng)
    )
    return lamps + perhaps_ambient(rng)


def point_lights(rng: np.random.Generator) -> tuple[Light, ...]:
    """One or two lamps 2.5 to 6 object units from the object's middle, and ambient light in three
    of four draws.
    """
    lamps = []
    for place, strength in places(rng):
        distance = rng.uniform(_NEAR, _FAR)
        lamps.append(PointLight(distance * place, np.pi * strength * distance**2 * white(rng)))
    return (*lamps, *perhaps_ambient(rng))
