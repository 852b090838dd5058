"""Cloth and fur: plush, knitted and terry bodies, cushions, balls of wool, brushes.

Equation: a soft body is displaced by what its surface is made of: tufts (cells), stitches (a
product of sines along two coordinates), cords (tubes), or combed hair (noise stretched along the
lie of the hair).
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.forms import ball, displaced, placed, tube
from ..geometry.implicit import Ellipsoid, blended
from ..geometry.noise import cells, fractal, noise
from ..geometry.surface import Surface, together


def make(rng: np.random.Generator) -> Surface:
    """Make a soft body.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    styles: tuple[Callable[[np.random.Generator], Surface], ...] = (
        _cushion,
        _plush,
        _wool,
        _knitted,
    )
    return styles[int(rng.integers(len(styles)))](rng)


def _covered(body: Surface, rng: np.random.Generator) -> Surface:
    """Tufts, terry, hair or felt on a body."""
    points = body.vertices
    style = int(rng.integers(4))
    if style == 0:
        nearest, _ = cells(points, rng.uniform(0.06, 0.11), rng)
        return displaced(body, rng.uniform(0.02, 0.05) * (0.6 - nearest))
    if style == 1:
        lie = rng.uniform(0.15, 0.4, 3)
        lie[int(rng.integers(3))] = 1.0
        warped = points + 0.15 * noise(points, 1.5, rng)[:, None]
        hair = fractal(warped * lie, rng.uniform(10, 16), 2, 0.7, rng)
        return displaced(body, rng.uniform(0.004, 0.011) * hair)
    if style == 2:
        return displaced(body, rng.uniform(0.004, 0.012) * fractal(points, 12, 2, 0.8, rng))
    locks, gap = cells(points + 0.08 * noise(points, 3, rng)[:, None], 0.22, rng)
    return displaced(body, 0.04 * (0.5 - locks) + 0.02 * np.minimum(gap, 0.4))


def _cushion(rng: np.random.Generator) -> Surface:
    base = ball(66)
    x, y, z = base.vertices.T
    power = rng.uniform(0.3, 0.7)
    square = np.stack([np.sign(x) * np.abs(x) ** power, np.sign(z) * np.abs(z) ** power], -1)
    pinch = 1 - rng.uniform(0.0, 0.12) * (1 - np.abs(square[:, 0] * square[:, 1]))
    flat = rng.uniform(0.3, 0.6) * y * (1 + 0.06 * noise(base.vertices, 1.5, rng))
    body = Surface(np.stack([square[:, 0] * pinch, flat, square[:, 1] * pinch], -1), base.faces)
    wrinkles = noise(body.vertices * (1, 0.4, 1), 2.5, rng) * np.exp(-((y / 0.5) ** 2))
    body = displaced(body, rng.uniform(0.005, 0.03) * wrinkles)
    if rng.random() < 0.4:  # buttoned
        body = displaced(body, -0.25 * np.exp(-(square[:, 0] ** 2 + square[:, 1] ** 2) / 0.05))
    return _covered(body, rng)


def _plush(rng: np.random.Generator) -> Surface:
    """A round toy with ears and feet."""
    size = rng.uniform(0.45, 0.6)
    parts: list[Ellipsoid] = [
        Ellipsoid((0, -0.35, 0), (0.55, 0.6, 0.5)),
        Ellipsoid((0, 0.5, 0.08), (size, 0.9 * size, 0.9 * size)),
        Ellipsoid((0, 0.38, 0.5), (0.22, 0.17, 0.2)),
        Ellipsoid((0, 0.45, 0.7), (0.07, 0.05, 0.05)),
    ]
    ear = rng.uniform(0.15, 0.5)
    for side in (-1.0, 1.0):
        parts += [
            Ellipsoid((side * 0.4, 0.85 + 0.5 * ear, 0), (0.17, ear, 0.09)),
            Ellipsoid((side * 0.55, -0.2, 0.25), (0.2, 0.32, 0.2)),
            Ellipsoid((side * 0.38, -0.85, 0.35), (0.23, 0.2, 0.38)),
            Ellipsoid((side * 0.2, 0.6, 0.52), (0.06, 0.07, 0.05)),
        ]
    return _covered(blended(list(parts), 0.02, cells=84), rng)


def _wool(rng: np.random.Generator) -> Surface:
    """A ball of wool: cords along great circles."""
    thick, u = rng.uniform(0.04, 0.07), np.linspace(0, 2 * np.pi, 72)
    parts = [placed(ball(24), scale=0.93)]
    circle = np.stack([np.cos(u), 0 * u, np.sin(u)], -1)
    for _ in range(6):
        bundle = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
        for k in np.linspace(-0.4, 0.4, 7):
            path = circle * np.sqrt(1 - k**2) + (0, k, 0)
            path = path * (1 + rng.uniform(-0.03, 0.05))
            parts.append(placed(tube(path, np.full(72, thick), 8), turn=bundle))
    return together(parts)


def _knitted(rng: np.random.Generator) -> Surface:
    """A hat, sock or ball in stocking stitch."""
    base = ball(74)
    d = base.vertices
    high = rng.uniform(0.7, 1.5)
    body = placed(base, scale=np.array([1, high, 1]))
    body = displaced(body, rng.uniform(0.02, 0.12) * noise(d, 1.2, rng))
    angle, rows = np.arctan2(d[:, 0], d[:, 2]), int(rng.integers(9, 20))
    across = angle * rows / 2
    slant = np.abs(np.mod(across / np.pi, 1) - 0.5)
    along = body.vertices[:, 1] * rows / np.pi / 2 * 2 + slant
    stitch = np.abs(np.sin(np.pi * along)) ** 0.6 * np.abs(np.sin(across)) ** 0.5
    body = displaced(body, rng.uniform(0.02, 0.05) * stitch)
    return displaced(body, 0.003 * fractal(body.vertices, 12, 2, 0.7, rng))
