"""Shared parts of generated lights: positions around the object, near-white colours, and the weak
ambient light that fills shadows.

Equation: a direction is given by its tilt from the viewing axis and its turn from straight up,
clockwise as seen by the viewer: d = (sin tilt sin turn, sin tilt cos turn, cos tilt).

Limits: only lights on the viewer's side, with a tilt below 90 degrees, reach the visible side.
"""

import numpy as np

from isc_core.shading.environment_map import directions

from ..scene.lights import EnvironmentLight

_TINT = 0.03
_AMBIENT_ROWS = 16


def toward(tilt: float, turn: float) -> np.ndarray:
    """Return a unit vector from two angles.

    Parameters
    ----------
    tilt : float
        From the viewing axis, degrees.
    turn : float
        From straight up, clockwise, degrees.

    Returns
    -------
    (3,) ndarray
        The direction, camera frame.
    """
    t, a = np.radians(tilt), np.radians(turn)
    return np.array([np.sin(t) * np.sin(a), np.sin(t) * np.cos(a), np.cos(t)])


def white(rng: np.random.Generator) -> np.ndarray:
    """Draw a colour within a few per cent of white.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    (3,) ndarray
        Linear Rec.709, of mean 1.
    """
    colour = 1 + rng.uniform(-_TINT, _TINT, 3)
    return colour / colour.mean()


def places(rng: np.random.Generator) -> list[tuple[np.ndarray, float]]:
    """Draw directions and strengths of one or two lights.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    list of ((3,) ndarray, float)
        A key light above or at a side and, in half of the draws, a weaker one on the other side.
    """
    turn = rng.uniform(-95, 95)
    key = (toward(rng.uniform(20, 65), turn), 1.0)
    if rng.uniform() < 0.5:
        return [key]
    across = turn + rng.choice([-1, 1]) * rng.uniform(90, 170)
    return [key, (toward(rng.uniform(30, 70), across), rng.uniform(0.2, 0.8))]


def ambient(rng: np.random.Generator, weakest: float, strongest: float) -> EnvironmentLight:
    """Draw light from all directions, brighter from above.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    weakest, strongest : float
        Range of the mean radiance of a white diffuse surface.

    Returns
    -------
    EnvironmentLight
        The light.
    """
    level, contrast = np.exp(rng.uniform(np.log(weakest), np.log(strongest))), rng.uniform(0.2, 0.8)
    height = directions(_AMBIENT_ROWS)[..., 1]
    return EnvironmentLight(level * (1 + contrast * height)[..., None] * white(rng))


def perhaps_ambient(rng: np.random.Generator, share: float = 0.75) -> tuple[EnvironmentLight, ...]:
    """Draw weak ambient light, or none.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    share : float, optional
        Probability of ambient light.

    Returns
    -------
    tuple of EnvironmentLight
        One light or none.
    """
    return (ambient(rng, 0.02, 0.15),) if rng.uniform() < share else ()
