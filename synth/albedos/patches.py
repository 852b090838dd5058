"""2 to 6 colours in separate areas: stripes, cells, or the level sets of a smooth field; edges are
a texel wide.
"""

import numpy as np

from .colours import palette
from .fields import ASPECT, grid, smooth_noise, softened


def texture(rng: np.random.Generator, size: int) -> np.ndarray:
    """Draw a texture of stripes, cells or level sets.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    size : int
        Side in texels.

    Returns
    -------
    (size, size, 3) ndarray
        Linear Rec.709.
    """
    colours = palette(rng, int(rng.integers(2, 7)))
    areas = (_stripes, _cells, _levels)[rng.integers(3)]
    return softened(colours[areas(rng, size, len(colours))])


def _stripes(rng: np.random.Generator, size: int, count: int) -> np.ndarray:
    """Indices (size, size) of rings, upright stripes or screws of uneven width; an integer number
    around keeps the seam closed.
    """
    u, v = grid(size)
    repeats = int(rng.integers(1, 4))
    kind = rng.integers(3)
    place = ((v, 0), (v * 0, 1), (v, rng.choice((-1, 1))))[kind]
    phase = (
        repeats * (place[0] + place[1] * u)
        + rng.uniform(0, 0.04) * smooth_noise(rng, size, 3)
        + rng.uniform()
    )
    ends = np.cumsum(rng.uniform(0.4, 1.6, count))
    return np.searchsorted(ends[:-1] / ends[-1], np.mod(phase, 1))


def _cells(rng: np.random.Generator, size: int, count: int) -> np.ndarray:
    """Indices (size, size) of Voronoi cells of random points, each with one of the colours."""
    u, v = grid(size)
    bend = rng.uniform(0, 0.02)
    u, v = u + bend * smooth_noise(rng, size, 5) / ASPECT, v + bend * smooth_noise(rng, size, 5)
    places = rng.uniform(size=(int(rng.integers(2, 6)) * count, 2))
    nearest, index = np.full(u.shape, np.inf), np.zeros(u.shape, int)
    for number, (x, y) in enumerate(places):
        across = np.mod(u - x + 0.5, 1) - 0.5
        distance = np.square(ASPECT * across) + np.square(v - y)
        index = np.where(distance < nearest, number % count, index)
        nearest = np.minimum(distance, nearest)
    return index


def _levels(rng: np.random.Generator, size: int, count: int) -> np.ndarray:
    """Indices (size, size) of bands of equal area between the level lines of a smooth field."""
    field = smooth_noise(rng, size, rng.uniform(1.2, 3.5))
    return np.searchsorted(np.quantile(field, np.arange(1, count) / count), field)
