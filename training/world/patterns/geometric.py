"""Stripes, checks and dots.

Equation: the phase of a stripe is x p + y q with whole p and q, so that the map tiles in any
direction; levels are a function of the phase's fraction.
"""

import numpy as np

from .canvas import FINER, Painting, averaged, filtered_noise, places, wave_vector


def stripes(rng: np.random.Generator, side: int) -> Painting:
    """Draw straight or wavy stripes, rays or rings.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    fine = FINER * side
    x, y = places(fine)
    style = rng.random()
    if style < 0.7:
        p, q = wave_vector(rng, 1.5, 16)
        phase = p * x + q * y
        if rng.random() < 0.3:
            phase = phase + rng.uniform(0.1, 0.6) * filtered_noise(rng, fine, 4)
        if rng.random() < 0.2:
            phase = phase + rng.uniform(0.1, 0.4) * _zigzag((q * x - p * y) / 2)
        return Painting(averaged(_levels(rng, phase)), True)
    dx, dy = x - rng.uniform(0.2, 0.8), y - rng.uniform(0.2, 0.8)
    if style < 0.85:
        phase = np.hypot(dx, dy * rng.uniform(0.6, 1.6)) * rng.uniform(3, 14)
    else:
        phase = np.arctan2(dy, dx) / (2 * np.pi) * int(rng.integers(3, 20))
    return Painting(averaged(_levels(rng, phase)), False)


def checks(rng: np.random.Generator, side: int) -> Painting:
    """Draw a checkerboard, gingham, tartan, tiles, bricks, diamonds or triangles.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    x, y = places(FINER * side)
    style = int(rng.integers(6))
    p, q = wave_vector(rng, 1.5, 9)
    across, along = p * x + q * y, -q * x + p * y
    if style == 0:
        values = (np.floor(2 * across) + np.floor(2 * along)) % 2
    elif style == 1:
        values = _levels(rng, across, 0) / 2 + _levels(rng, along, 0) / 2
    elif style == 2:
        bands = rng.uniform(0, 1, int(rng.integers(4, 12)))
        values = (_banded(bands, across) + _banded(bands, along)) / 2
    elif style == 3:  # tiles or bricks, each of a shade of its own
        wide, joint = int(rng.choice([1, 2])), rng.uniform(0.04, 0.15)
        shift = 0.5 * (np.floor(along * wide) % 2) if rng.random() < 0.5 else 0
        values = _tiles(rng, across + shift, along * wide, joint)
        return Painting(averaged(values), False)
    elif style == 4:
        values = (np.abs(across % 1 - 0.5) + np.abs(along % 1 - 0.5) < rng.uniform(0.25, 0.5)) * 1.0
        lines = np.abs((across + along) % 1 - 0.5) < 0.04
        values = np.where(lines, 0.5, values) if rng.random() < 0.4 else values
    else:
        values = ((across % 1) + (along % 1) > 1) * 1.0
    return Painting(averaged(values), True)


def dots(rng: np.random.Generator, side: int) -> Painting:
    """Draw polka dots, rings, a halftone, or discs scattered at random.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    x, y = places(FINER * side)
    if rng.random() < 0.35:
        return Painting(averaged(_scattered(rng, x, y)), True)
    p, q = wave_vector(rng, 2, 14)
    u, v = p * x + q * y, -q * x + p * y
    if rng.random() < 0.5:
        u = u + 0.5 * (np.floor(v) % 2)  # every other row is shifted: even rows make it tile
    u, v = u % 1 - 0.5, v % 1 - 0.5
    distance = np.hypot(u, v)
    radius: np.ndarray | float = rng.uniform(0.12, 0.45)
    halftone = rng.random() < 0.25
    if halftone:
        radius = 0.05 + 0.5 * np.clip(x * rng.uniform(-1, 1) + y * rng.uniform(-1, 1) + 0.5, 0, 1)
    values = (distance < radius) * 1.0
    if rng.random() < 0.25:
        values = values * (distance > radius * rng.uniform(0.4, 0.8))
    return Painting(averaged(values), not halftone and (p + q) % 2 == 0)


def _zigzag(phase: np.ndarray) -> np.ndarray:
    return np.abs(4 * (phase % 1) - 2) - 1


def _banded(bands: np.ndarray, phase: np.ndarray) -> np.ndarray:
    return np.asarray(bands[np.floor(phase % 1 * len(bands)).astype(int) % len(bands)])


def _levels(rng: np.random.Generator, phase: np.ndarray, style: int | None = None) -> np.ndarray:
    """Two levels, several bands, or a soft wave over the phase."""
    style = int(rng.choice(3, p=(0.55, 0.3, 0.15))) if style is None else style
    if style == 0:
        return (phase % 1 < rng.uniform(0.1, 0.9)) * 1.0
    if style == 1:
        return _banded(np.rint(rng.uniform(0, 1, int(rng.integers(5, 24))) * 3) / 3, phase)
    return np.asarray(0.5 + 0.5 * np.sin(2 * np.pi * phase))


def _tiles(rng: np.random.Generator, u: np.ndarray, v: np.ndarray, joint: float) -> np.ndarray:
    shades = rng.uniform(0.55 if rng.random() < 0.7 else 0.1, 1, (64, 64))
    tile = shades[np.floor(u).astype(int) % 64, np.floor(v).astype(int) % 64]
    return np.where((u % 1 < joint) | (v % 1 < joint), 0, tile)


def _scattered(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Discs of several sizes, wrapped around the edges, each in front of the last."""
    values = np.zeros(x.shape)
    several = rng.random() < 0.4
    largest = np.exp(rng.uniform(np.log(0.015), np.log(0.2)))
    for _ in range(int(rng.integers(0.2 / largest, 1.2 / largest) + 3)):
        middle, radius = rng.uniform(0, 1, 2), largest * rng.uniform(0.4, 1)
        dx = (x[0] - middle[0] + 0.5) % 1 - 0.5
        dy = (y[:, 0] - middle[1] + 0.5) % 1 - 0.5
        columns, rows = np.abs(dx) < radius, np.abs(dy) < radius
        inside = np.hypot(dx[columns], dy[rows][:, None]) < radius
        block = np.ix_(rows, columns)
        level = rng.choice([1 / 3, 2 / 3, 1]) if several else 1
        values[block] = np.where(inside, level, values[block])
    return values
