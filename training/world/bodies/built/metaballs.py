"""Metaballs: lumps, toys, dough, clouds, molten forms, made with Blender.

Equation: balls, capsules and ellipsoids along random walks and rings; some count negative. Fine
displacement is added.
"""

import numpy as np

from ..geometry.blender import emptied, linked, surface_of
from ..geometry.forms import displaced
from ..geometry.noise import fractal
from ..geometry.parts import largest_piece
from ..geometry.surface import Surface, welded


def make(rng: np.random.Generator) -> Surface:
    """Make a body of metaballs.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    bpy = emptied()
    data = bpy.data.metaballs.new("body")
    data.resolution, data.threshold = 0.055, rng.uniform(0.3, 0.7)
    for place, size in _walk(rng):
        element = data.elements.new(type=str(rng.choice(["BALL", "CAPSULE", "ELLIPSOID"])))
        element.co, element.radius = place.tolist(), size
        element.size_x, element.size_y, element.size_z = rng.uniform(0.3, 1, 3).tolist()
        quaternion = rng.normal(size=4)
        element.rotation = (quaternion / np.linalg.norm(quaternion)).tolist()
    for place, size in _walk(rng)[: int(rng.integers(0, 3))]:
        element = data.elements.new()
        element.co, element.radius, element.use_negative = (1.3 * place).tolist(), 0.8 * size, True
    surface = largest_piece(welded(surface_of(linked(bpy, data)))[0])
    rough = fractal(surface.vertices, rng.uniform(2, 6), 3, 0.5, rng)
    return displaced(surface, rng.choice([0, 0, 0.004, 0.01]) * rough)


def _walk(rng: np.random.Generator) -> list[tuple[np.ndarray, float]]:
    """Places and radii of the elements: a walk, mirrored at times, or a ring."""
    count = int(rng.integers(4, 14))
    steps = rng.normal(0, 0.45, (count, 3))
    places = np.cumsum(steps, axis=0) if rng.random() < 0.6 else 1.2 * steps
    if rng.random() < 0.25:
        turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
        places = np.stack([np.cos(turn), np.sin(turn), 0.3 * np.sin(3 * turn)], -1)
    places = places - places.mean(0)
    places *= min(1.0, 1.4 / np.abs(places).max())
    radii = rng.uniform(0.35, 0.85, count)
    pairs = list(zip(places, radii.tolist(), strict=True))
    mirrored = [(place * (-1, 1, 1), size) for place, size in pairs]
    return pairs + mirrored if rng.random() < 0.5 else pairs
