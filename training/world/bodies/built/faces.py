"""Reliefs: suns and moons with faces, masks, coins, medallions, plaques with rosettes and waves.

Equation: a disc, star or rounded plate whose front height is a sum of bumps: domes for cheeks, a
ridge for the nose, dents for eyes, rays around the rim, rings and rosettes.
"""

import numpy as np

from ..geometry.forms import from_grid, placed
from ..geometry.noise import fractal
from ..geometry.surface import Surface

_ROWS, _COLUMNS = 72, 216


def make(rng: np.random.Generator) -> Surface:
    """Make a relief.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        Facing z, tilted back a little.
    """
    r, a = np.meshgrid(
        np.linspace(0, 1, _ROWS), np.linspace(0, 2 * np.pi, _COLUMNS + 1), indexing="ij"
    )
    outline = _outline(a, rng)
    x, y = r * outline * np.sin(a), r * outline * np.cos(a)
    height = _front(x, y, r, a, rng) if rng.random() < 0.7 else _ornament(r, a, rng)
    height = height * rng.uniform(0.7, 1.5)
    height += 10 ** rng.uniform(-3.2, -2.2) * fractal(
        np.stack([x, y, height], -1).reshape(-1, 3), 6, 3, 0.6, rng
    ).reshape(x.shape)
    thick = rng.uniform(0.06, 0.25)
    rim = np.sqrt(np.clip(1 - r**24, 0, 1))
    front = np.stack([x, y, thick * rim + height * rim], -1)
    back = np.stack([x, y, -0.3 * thick * rim], -1)
    surface = _closed(front, back)
    tilt = np.radians(rng.uniform(-30, 10))
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    return placed(surface, turn=turn)


def _closed(front: np.ndarray, back: np.ndarray) -> Surface:
    return from_grid(np.concatenate([front, back[::-1]]))


def _outline(a: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Radius by angle: round, rayed, scalloped or square."""
    style, count = int(rng.integers(5)), int(rng.integers(7, 20))
    depth = rng.uniform(0.1, 0.4)
    if style == 0:
        return np.asarray(1 - depth * np.abs(np.mod(count * a / np.pi, 2) - 1))
    if style == 1:
        return np.asarray(1 - 0.4 * depth * (1 - np.abs(np.cos(count * a / 2))))
    if style == 2:
        return np.asarray(1 / (np.abs(np.cos(a)) ** 8 + np.abs(np.sin(a) / 0.8) ** 8) ** (1 / 8))
    return np.asarray(np.ones_like(a))


def _bump(
    x: np.ndarray, y: np.ndarray, at: tuple[float, float], size: tuple[float, float]
) -> np.ndarray:
    return np.exp(-(((x - at[0]) / size[0]) ** 2) - ((y - at[1]) / size[1]) ** 2)


def _front(
    x: np.ndarray, y: np.ndarray, r: np.ndarray, a: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Height of a face."""
    size = rng.uniform(0.55, 0.8)
    x, y, s = x / size, y / size, np.hypot(x, y) / size
    dome = rng.uniform(0.15, 0.4) * np.sqrt(np.clip(1 - s**2, 0, 1))
    apart, smile = rng.uniform(0.28, 0.42), rng.uniform(-0.3, 0.9)
    face = 0.2 * _bump(x, y, (0, -0.05), (0.1, 0.28)) + 0.07 * _bump(x, y, (0, -0.2), (0.17, 0.1))
    for side in (-1, 1):
        face += 0.1 * _bump(x, y, (side * 0.5, -0.25), (0.22, 0.2))
        face -= 0.14 * _bump(x, y, (side * apart, 0.18), (0.19, 0.12))
        eye = np.hypot((x - side * apart) / 0.13, (y - 0.17) / 0.09)
        face += 0.1 * np.sqrt(np.clip(1 - eye**2, 0, 1))
        brow = y - 0.36 + 0.6 * (np.abs(x) - apart) ** 2
        face += 0.06 * np.exp(-((brow / 0.05) ** 2)) * (np.abs(np.abs(x) - apart) < 0.22)
    curve = y + 0.5 - smile * 0.35 * x**2
    lips = np.exp(-(((np.abs(curve) - 0.055) / 0.045) ** 2)) - 0.9 * np.exp(-((curve / 0.02) ** 2))
    face += 0.06 * lips * np.exp(-((x / 0.3) ** 6))
    rays = np.clip((s - 1.03) / 0.05, 0, 1)
    count = int(rng.integers(8, 30))
    wave = rng.uniform(0, 2) * r
    rays = rays * 0.06 * (1 + np.cos(count * a + wave * 2))
    return np.asarray(dome + face * (s < 1) + rays + 0.04 * np.exp(-(((s - 1.0) / 0.05) ** 2)))


def _ornament(r: np.ndarray, a: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Height of rings, rosettes and beads."""
    height = 0.25 * rng.random() * np.sqrt(np.clip(1 - (r / rng.uniform(0.3, 0.9)) ** 2, 0, 1))
    for _ in range(int(rng.integers(2, 6))):
        at, width, count = rng.uniform(0.15, 0.95), rng.uniform(0.02, 0.1), int(rng.integers(3, 36))
        ring = np.exp(-(((r - at) / width) ** 2))
        beads = np.abs(np.cos(count * a / 2 + rng.uniform(-4, 4) * r)) ** rng.uniform(0.5, 4)
        height = height + rng.uniform(-0.06, 0.1) * ring * (beads if rng.random() < 0.75 else 1)
    return np.asarray(height)
