"""Softboxes and windows: one or two rectangles that face the object, always with a little ambient
light.

Equation: a panel of area A at the distance r that faces the origin gives it about L A / r^2 of
irradiance; L is chosen so that this is pi.

Limits: panels are uniform, without frames or window bars.
"""

import numpy as np

from ..scene.lights import Light, panel_toward_origin
from .placing import ambient, places, white

_NEAR, _FAR = 3.0, 6.0


def area_lights(rng: np.random.Generator) -> tuple[Light, ...]:
    """Draw one or two panels and weak ambient light.

    Their sides subtend 10 to 40 degrees at the object; windows are upright.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    tuple of Light
        The panels, then the ambient light.
    """
    panels = []
    for place, strength in places(rng):
        distance, side = rng.uniform(_NEAR, _FAR), 2 * np.tan(np.radians(rng.uniform(10, 28)) / 2)
        size = distance * side * np.array([1.0, rng.choice([1.0, rng.uniform(1.2, 1.5)])])
        radiance = np.pi * strength * distance**2 / size.prod() * white(rng)
        panels.append(
            panel_toward_origin(tuple(distance * place), (size[0], size[1]), tuple(radiance))
        )
    return (*panels, ambient(rng, 0.02, 0.15))
