"""Plants: leaves, flowers, succulents, mushrooms, cabbages and potted plants.

Equation: a leaf is a sheet whose width follows a power of the sine along its length, cupped across,
bent along, with a mid-rib, veins and a wavy margin; plants set leaves at golden-angle turns.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.forms import curve, displaced, placed, revolved, sheet, tube
from ..geometry.noise import fractal
from ..geometry.surface import Surface, together

_GOLDEN = np.pi * (3 - np.sqrt(5))


def make(rng: np.random.Generator) -> Surface:
    """Make a plant or a leaf.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    styles: tuple[Callable[[np.random.Generator], list[Surface]], ...] = (
        _lone_leaf,
        _flower,
        _rosette,
        _potted,
        _mushroom,
        _cabbage,
    )
    return together(styles[int(rng.integers(len(styles)))](rng))


def _leaf(rng: np.random.Generator, rows: int = 40, columns: int = 17) -> Surface:
    """A leaf of length 1 along z from the origin, its upper side up."""
    u, v = np.meshgrid(np.linspace(0, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    broad, belly = rng.uniform(0.12, 0.4), rng.uniform(0.6, 1.4)
    margin, teeth = rng.uniform(0, 0.12), int(rng.integers(3, 14))
    width = broad * np.sin(np.pi * np.clip(u, 0.015, 0.985) ** belly)
    width = width * (1 - margin * np.abs(np.sin(teeth * np.pi * u)))
    x = v * width
    cup, rib = rng.uniform(-0.3, 0.5), rng.uniform(0, 0.03)
    y = cup * x**2 / broad - rib * np.exp(-((x / 0.02) ** 2))
    y += rng.uniform(0, 0.012) * np.sin(teeth * 2 * np.pi * (u - 0.5 * np.abs(v)))
    y += rng.uniform(0, 0.06) * v**2 * np.sin(teeth * 1.7 * u + 2 * v)
    bend = rng.uniform(-0.3, 1.4)
    angle = bend * u
    z = np.sin(angle) / bend if abs(bend) > 0.05 else u
    drop = (np.cos(angle) - 1) / bend if abs(bend) > 0.05 else 0 * u
    points = np.stack([x, y * np.cos(angle) + drop, z + y * np.sin(angle)], -1)
    return sheet(points, rng.uniform(0.008, 0.02))


def _turned(yaw: float, lift: float) -> np.ndarray:
    """Rotation that lifts a leaf's tip by `lift` and then turns it around y, radians."""
    return Rotation.from_euler("xy", [-lift, yaw]).as_matrix()


def _lone_leaf(rng: np.random.Generator) -> list[Surface]:
    leaf = _leaf(rng, 130, 61)
    leaf = displaced(leaf, 0.003 * fractal(leaf.vertices, 5, 3, 0.6, rng))
    stalk = np.array([[0, -0.02, -0.3], [0, 0.01, -0.1], [0, 0, 0.05]])
    parts = [leaf, tube(curve(stalk, 20), np.full(20, 0.015), 10)]
    turn = _turned(rng.uniform(0, 6.3), rng.uniform(0, 1.3))
    return [placed(part, turn=turn) for part in parts]


def _flower(rng: np.random.Generator) -> list[Surface]:
    parts: list[Surface] = []
    petal = _leaf(rng, 36, 15)
    for ring in range(int(rng.integers(1, 4))):
        count = int(rng.integers(5, 13))
        for k in range(count):
            turn = _turned(2 * np.pi * (k + 0.5 * ring) / count, 0.25 + 0.35 * ring)
            parts.append(placed(petal, (0, 0.03 * ring, 0), 1 - 0.18 * ring, turn))
    seeds = revolved(np.array([[0, -0.06], [0.2, -0.03], [0.22, 0.04], [0.15, 0.1], [0, 0.12]]), 48)
    bumps = displaced(seeds, 0.01 * fractal(seeds.vertices, 14, 1, 1, rng))
    stalk = np.array([[0, 0, 0], [0.04, -0.7, 0.03], [rng.normal(0, 0.2), -1.5, 0]])
    return [*parts, bumps, tube(curve(stalk, 40), np.full(40, 0.035), 12)]


def _rosette(rng: np.random.Generator) -> list[Surface]:
    """A succulent, an artichoke, a cone: leaves in spirals, steeper inside."""
    count, fat = int(rng.integers(18, 48)), rng.uniform(0.05, 0.2)
    path = np.array([[0, 0, 0], [0, 0, 0.5], [0, 0.12, 1.0]])
    blade = tube(
        curve(path, 16), fat * np.array([*np.linspace(0.6, 1.6, 10), *np.linspace(1.5, 0.2, 6)]), 12
    )
    blade = placed(blade, scale=np.array([rng.uniform(1, 2), 0.8, 1]))
    parts = []
    for k in range(count):
        inside = k / count
        turn = _turned(k * _GOLDEN, 0.1 + 1.35 * inside)
        parts.append(placed(blade, (0, 0.4 * inside, 0), 1 - 0.55 * inside, turn))
    return parts


def _potted(rng: np.random.Generator) -> list[Surface]:
    profile = np.array(
        [
            [0, 0],
            [0.3, 0],
            [0.42, 0.6],
            [0.48, 0.6],
            [0.48, 0.72],
            [0.4, 0.72],
            [0.38, 0.6],
            [0, 0.6],
        ]
    )
    parts = [revolved(profile, 80)]
    leaf = _leaf(rng, 30, 11)
    for k in range(int(rng.integers(6, 22))):
        reach, yaw = rng.uniform(0.3, 0.9), k * _GOLDEN
        tip = np.array([0.5 * reach * np.sin(yaw), 0.6 + reach, 0.5 * reach * np.cos(yaw)])
        stalk = np.array([[0, 0.55, 0], [0.25 * tip[0], 0.6 + 0.6 * reach, 0.25 * tip[2]], tip])
        parts.append(tube(curve(stalk, 16), np.full(16, 0.018), 8))
        size, lift = rng.uniform(0.35, 0.8), rng.uniform(-0.2, 0.9)
        parts.append(placed(leaf, tip, size, _turned(yaw, lift)))
    return parts


def _mushroom(rng: np.random.Generator) -> list[Surface]:
    parts = []
    for k in range(int(rng.integers(1, 4))):
        wide, high = rng.uniform(0.35, 0.8), rng.uniform(0.2, 0.6)
        cap = np.array([[0, high], [0.6 * wide, 0.8 * high], [wide, 0.1], [0.95 * wide, -0.04]])
        gills = np.array([[0.15, 0.04], [0, 0.04]])
        profile = np.concatenate([curve(cap, 40), gills])
        stem = np.array([[0, -1, 0], [0.03, -0.5, 0.02], [0, 0.08, 0]])
        radius = rng.uniform(0.1, 0.2) * np.linspace(rng.uniform(0.8, 1.8), 0.8, 24)
        bodies = [revolved(profile, 110), tube(curve(stem, 24), radius, 28)]
        for body in bodies:
            rough = displaced(
                body, rng.uniform(0.005, 0.03) * fractal(body.vertices, 2, 3, 0.5, rng)
            )
            turn = Rotation.from_euler("xz", rng.normal(0, 0.15, 2)).as_matrix()
            parts.append(placed(rough, (0.7 * k, 0, 0.3 * k), 1 - 0.25 * k, turn))
    return parts


def _cabbage(rng: np.random.Generator) -> list[Surface]:
    """Cupped leaves around a heart."""
    u, v = np.meshgrid(np.linspace(0.02, 1, 44), np.linspace(-1, 1, 44), indexing="ij")
    parts = []
    for k in range(int(rng.integers(5, 10))):
        polar = np.pi * (0.95 - 0.75 * u)
        around = v * 1.25 * np.sin(np.pi * u**0.6) + k * _GOLDEN
        frill = 0.05 * u**3 * np.sin(12 * v + k) + 0.02 * np.sin(16 * (u - np.abs(v)))
        radius = 1 - 0.06 * k + (0.25 * u**3 if k < 3 else 0) + frill
        points = np.stack(
            [
                radius * np.sin(polar) * np.sin(around),
                radius * np.cos(polar),
                radius * np.sin(polar) * np.cos(around),
            ],
            -1,
        )
        parts.append(sheet(points, 0.02))
    return parts
