"""Stones, loaves and lumps: noise at several scales on a ball, cut by random planes.

Equation: a ball stretched along its axes is clipped by planes n . x < c with rounded edges
(a smooth minimum), then displaced by fractal noise, ridged noise, pits or cracks.
"""

import numpy as np

from ..geometry.forms import ball, displaced, placed
from ..geometry.noise import cells, fractal
from ..geometry.surface import Surface


def make(rng: np.random.Generator) -> Surface:
    """Make a stone, loaf or lump.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    base = ball(64)
    directions = base.vertices
    radius = np.ones(len(directions))
    for _ in range(int(rng.integers(0, 14))):
        normal = rng.normal(size=3)
        toward = directions @ (normal / np.linalg.norm(normal))
        plane = rng.uniform(0.55, 0.95) / np.maximum(toward, 1e-3)
        radius = _smooth_minimum(radius, plane, rng.uniform(0.005, 0.08))
    body = Surface(directions * radius[:, None], base.faces)
    body = placed(body, scale=rng.uniform(0.55, 1.2, 3))
    body = displaced(body, rng.uniform(0.0, 0.12) * fractal(body.vertices, 1.2, 2, 0.5, rng))
    return displaced(body, _detail(body.vertices, rng))


def _smooth_minimum(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    mix = np.clip(0.5 + (b - a) / (2 * width), 0, 1)
    return np.asarray(b + (a - b) * mix - width * mix * (1 - mix))


def _detail(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Fine relief, one or two styles together."""
    rough = 10 ** rng.uniform(-3.3, -1.8) * fractal(points, rng.uniform(3, 7), 4, 0.5, rng)
    style = int(rng.integers(5))
    if style == 0:
        ridged = 1 - np.abs(fractal(points, rng.uniform(1, 2.5), 3, 0.4, rng))
        return rough + rng.uniform(0.02, 0.08) * ridged
    if style == 1:
        nearest, _ = cells(points, rng.uniform(0.1, 0.3), rng)
        return rough - rng.uniform(0.02, 0.06) * np.exp(-((nearest / 0.35) ** 2))
    if style == 2:
        _, gap = cells(points, rng.uniform(0.25, 0.6), rng)
        return rough - rng.uniform(0.02, 0.06) * np.exp(-gap / 0.06)
    if style == 3:
        layers = np.sin(points[:, 1] * rng.uniform(15, 40) + fractal(points, 1.5, 2, 0.5, rng))
        return rough + rng.uniform(0.003, 0.015) * layers
    return rough
