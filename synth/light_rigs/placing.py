"""What invented lights share: places around the object, near whites, and the weak light that keeps
shadows from being black.

Equation: a place is given by its tilt from the viewing axis and its turn from straight up,
clockwise as the viewer sees it: d = (sin tilt sin turn, sin tilt cos turn, cos tilt).

Limits: only the side of the viewer, tilt below 90 degrees, reaches what the viewer sees.
"""

import numpy as np

from isc_core.shading.environment_map import directions

from ..scene.lights import EnvironmentLight

_TINT = 0.03
_AMBIENT_ROWS = 16


def toward(tilt: float, turn: float) -> np.ndarray:
    """The unit vector (3,) at `tilt` from the viewing axis and `turn` from straight up, both in
    degrees.
    """
    t, a = np.radians(tilt), np.radians(turn)
    return np.array([np.sin(t) * np.sin(a), np.sin(t) * np.cos(a), np.cos(t)])


def white(rng: np.random.Generator) -> np.ndarray:
    """A colour (3,) within a few per cent of white, of mean 1."""
    colour = 1 + rng.uniform(-_TINT, _TINT, 3)
    return colour / colour.mean()


def places(rng: np.random.Generator) -> list[tuple[np.ndarray, float]]:
    """Where one or two lamps stand, (3,) unit vectors, and how strong they are: a key light above
    or at a side and, in half of the draws, a weaker one across from it.
    """
    turn = rng.uniform(-95, 95)
    key = (toward(rng.uniform(20, 65), turn), 1.0)
    if rng.uniform() < 0.5:
        return [key]
    across = turn + rng.choice([-1, 1]) * rng.uniform(90, 170)
    return [key, (toward(rng.uniform(30, 70), across), rng.uniform(0.2, 0.8))]


def ambient(rng: np.random.Generator, weakest: float, strongest: float) -> EnvironmentLight:
    """Light from all around, brighter from above: a white matt surface gets a radiance from
    `weakest` to `strongest` on the average.
    """
    level, contrast = np.exp(rng.uniform(np.log(weakest), np.log(strongest))), rng.uniform(0.2, 0.8)
    height = directions(_AMBIENT_ROWS)[..., 1]
    return EnvironmentLight(level * (1 + contrast * height)[..., None] * white(rng))


def perhaps_ambient(rng: np.random.Generator, share: float = 0.75) -> tuple[EnvironmentLight, ...]:
    """Weak ambient light in `share` of the draws, else none."""
    return (ambient(rng, 0.02, 0.15),) if rng.uniform() < share else ()
