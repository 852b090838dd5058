"""Wood: rings, grain, knots and the joints of boards.

Equation: the brightness follows the distance from a far, tilted axis, disturbed by noise that is
long along the trunk; a knot pushes the rings aside. Fibres are noise that is longer still.

Citation: D. R. Peachey (1985), "Solid texturing of complex surfaces", doi:10.1145/325165.325246.
"""

import numpy as np
from scipy.ndimage import map_coordinates

from .canvas import FINER, Painting, averaged, filtered_noise, places, stretched


def wood(rng: np.random.Generator, side: int) -> Painting:
    """Draw a board, several boards, or a cut across the trunk.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    fine = FINER * side
    x, y = (place - 0.5 for place in places(fine))
    if rng.random() < 0.3:
        values = _end_grain(rng, x, y)
    else:
        values = _board(rng, x, y)
        if rng.random() < 0.3:
            values = _boards(rng, values)
        if rng.random() < 0.5:
            values = values.T
    return Painting(stretched(averaged(values)), False)


def _ring(phase: np.ndarray, late: float) -> np.ndarray:
    """Early wood that darkens slowly, then a sharp line of late wood."""
    part = phase % 1
    return np.asarray(part**late * np.clip((1 - part) * 12, 0, 1))


def _end_grain(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    fine = len(x)
    dx, dy = x - rng.uniform(-0.5, 0.5), y - rng.uniform(-0.5, 0.5)
    distance = np.hypot(dx, dy) + 0.015 * filtered_noise(rng, fine, 4)
    rings = _ring(distance * rng.uniform(10, 30), rng.uniform(1, 3))
    cracks = np.arctan2(dy, dx) * 40 + 0.6 * filtered_noise(rng, fine, 3)
    rays = 0.15 * np.sin(cracks) * filtered_noise(rng, fine, 2)
    return np.asarray(rings * rng.uniform(0.4, 1) + rays)


def _board(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Rings of a trunk along x, cut close to or far from its axis, with fibres."""
    fine = len(x)
    bend = 0.04 * filtered_noise(rng, fine, 4, 1, (6, 1)) + rng.normal(0, 0.1) * x
    across = y - rng.uniform(-0.6, 0.6) + bend
    depth = rng.uniform(0, 0.4) + rng.uniform(-0.4, 0.4) * x
    distance = np.hypot(across, depth)
    for _ in range(int(rng.choice(4, p=(0.5, 0.25, 0.15, 0.1)))):
        kx, ky = rng.uniform(-0.4, 0.4, 2)
        size = rng.uniform(0.03, 0.09)
        near = np.hypot((x - kx) / 1.6, y - ky)
        distance = distance + size * np.exp(-((near / size) ** 2) / 2)
    rings = _ring(distance * rng.uniform(8, 40), rng.uniform(0.7, 3))
    fibres = filtered_noise(rng, fine, 1, 6, (rng.uniform(15, 40), 1))
    return np.asarray(rings * rng.uniform(0.3, 1) + rng.uniform(0.05, 0.2) * fibres)


def _boards(rng: np.random.Generator, values: np.ndarray) -> np.ndarray:
    """Strips of a board, each moved along, with dark joints."""
    fine = len(values)
    count = int(rng.integers(2, 7))
    board = np.arange(fine) * count // fine
    shift, shade = rng.uniform(0, fine, count)[board], rng.uniform(-0.3, 0.3, count)[board]
    columns = (np.arange(fine)[None] + shift[:, None]) % fine
    rows = np.broadcast_to(np.arange(fine)[:, None], columns.shape)
    moved = map_coordinates(values, [rows, columns], order=1, mode="grid-wrap")
    joint = (np.arange(fine) * count / fine) % 1 < 0.012 * count
    return np.where(joint[:, None], 1.2, moved + shade[:, None])
