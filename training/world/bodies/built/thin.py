"""Thin parts: wires, springs, racks, baskets, spectacles, hangers, forks, chains, wheels.

Equation: tubes along curves, one form a style, with a random section.
"""

from collections.abc import Callable

import numpy as np

from ..geometry.forms import curve, from_grid, placed, rounded_box, tube
from ..geometry.surface import Surface, together


def make(rng: np.random.Generator) -> Surface:
    """Make an object of thin parts.

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
        _wire,
        _spring,
        _rack,
        _basket,
        _cutlery,
        _chain,
        _wheel,
        _stool,
    )
    return together(styles[int(rng.integers(len(styles)))](rng))


def _ring(radius: float, thick: float, squash: float = 1.0, count: int = 64) -> Surface:
    """A ring around the y axis."""
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, count + 1), np.linspace(0, 2 * np.pi, 13))
    out = radius + thick * np.cos(b)
    return from_grid(np.stack([out * np.cos(a), thick * np.sin(b), squash * out * np.sin(a)], -1))


def _rod(ends: list[list[float]], thick: float) -> Surface:
    start, end = np.array(ends, float)
    return tube(np.linspace(start, end, 6), np.full(6, thick), 12)


def _wire(rng: np.random.Generator) -> list[Surface]:
    """A bent wire, cable or paper clip."""
    count = int(rng.integers(5, 14))
    flat = (1, 1, rng.choice([0.1, 1.0]))
    points = np.cumsum(rng.normal(0, 0.5, (count, 3)) * flat, axis=0)
    return [tube(curve(points, 30 * count), np.full(30 * count, 10 ** rng.uniform(-1.6, -0.9)), 16)]


def _spring(rng: np.random.Generator) -> list[Surface]:
    """A coil: spring, rope, corkscrew."""
    turns = rng.uniform(3, 9)
    u = np.linspace(0, 1, int(60 * turns))
    radius = 0.5 * (1 - rng.uniform(0, 0.8) * u)
    angle = 2 * np.pi * turns * u
    path = np.stack([radius * np.cos(angle), rng.uniform(0.6, 2) * u, radius * np.sin(angle)], -1)
    return [tube(path, np.full(len(u), rng.uniform(0.025, 0.1)), 16)]


def _rack(rng: np.random.Generator) -> list[Surface]:
    """A dish or toast rack, a grid."""
    count, thick, high = int(rng.integers(4, 11)), rng.uniform(0.015, 0.04), rng.uniform(0.3, 0.9)
    parts = [_rod([[-1, 0, z], [1, 0, z]], 1.4 * thick) for z in (-0.4, 0.4)]
    u = np.linspace(0, np.pi, 24)
    round_ = rng.uniform(0.3, 1)
    arch = np.stack([0 * u, high * np.sin(u) ** round_, -0.4 * np.cos(u)], -1)
    hoops = [
        tube(arch + (x, 0, 0), np.full(24, thick), 12) for x in np.linspace(-0.95, 0.95, count)
    ]
    return parts + hoops


def _basket(rng: np.random.Generator) -> list[Surface]:
    """Woven or of wires: rings and ribs of a bowl."""
    rings, ribs = int(rng.integers(4, 9)), int(rng.integers(10, 26))
    thick, belly = rng.uniform(0.015, 0.04), rng.uniform(0.0, 0.4)
    level = np.linspace(0, 1, rings)
    radius = 0.5 + 0.4 * level + belly * np.sin(np.pi * level)
    parts = [placed(_ring(r, thick), (0, h, 0)) for r, h in zip(radius, level, strict=True)]
    u = np.linspace(0, 1, 30)
    out = 0.5 + 0.4 * u + belly * np.sin(np.pi * u)
    for a in np.linspace(0, 2 * np.pi, ribs, endpoint=False):
        wave = 1 + 0.03 * np.cos(np.pi * (rings - 1) * u)
        path = np.stack([wave * out * np.cos(a), u, wave * out * np.sin(a)], -1)
        parts.append(tube(path, np.full(30, thick), 10))
    if rng.random() < 0.6:
        t = np.linspace(0, np.pi, 40)
        handle = np.stack([0.9 * np.cos(t), 1 + 0.8 * np.sin(t), 0 * t], -1)
        parts.append(tube(handle, np.full(40, 1.5 * thick), 14))
    return parts


def _cutlery(rng: np.random.Generator) -> list[Surface]:
    """A fork, spoon or spatula."""
    u, v = np.meshgrid(np.linspace(0, 1, 160), np.linspace(-1, 1, 31), indexing="ij")
    head = rng.uniform(0.25, 0.35)
    spoon = rng.random() < 0.5
    bowl = np.sqrt(np.clip(1 - ((u - head / 2) / (head / 2)) ** 2, 0, 1)) * (u < head)
    width = np.maximum(0.14 * bowl, 0.02 + 0.035 * np.clip(u - 0.5, 0, 1))
    height = 0.08 * np.sin(2.2 * np.pi * u) * (u > head / 2)
    height = height - 0.09 * (1 - v**2) * bowl if spoon else height
    points = np.stack([2 * (u - 0.5), height, 2 * v * width], -1)
    thick = 0.012 + 0.02 * (u > head)
    top, bottom = (
        points + (thick / 2)[..., None] * (0, 1, 0),
        points - (thick / 2)[..., None] * (0, 1, 0),
    )
    if not spoon:
        parts = [from_grid(np.concatenate([top[52:], bottom[52:][::-1], top[52:53]]))]
        for z in np.linspace(-0.1, 0.1, int(rng.integers(3, 5))):
            path = np.array(
                [[-0.3, 0, 0.4 * z], [-0.5, -0.05, z], [-0.75, -0.06, z], [-1, 0.03, z]]
            )
            parts.append(tube(curve(path, 30), np.linspace(0.035, 0.015, 30), 12, 0.6))
        return parts
    loop = np.concatenate([top, bottom[:, ::-1], top[:, :1]], axis=1)
    return [from_grid(loop)]


def _chain(rng: np.random.Generator) -> list[Surface]:
    """Links along an arc, each turned against the one before."""
    count, thick = int(rng.integers(5, 14)), rng.uniform(0.05, 0.09)
    bend = rng.uniform(0, 0.25)
    link = _ring(0.3, thick, rng.uniform(0.5, 0.8), 40)
    parts, place, heading = [], np.zeros(3), 0.0
    for k in range(count):
        c, s = np.cos(heading), np.sin(heading)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        roll = np.eye(3) if k % 2 else np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        parts.append(placed(link, place, turn=turn @ roll))
        place = place + 0.44 * turn[:, 0]
        heading += bend
    return parts


def _wheel(rng: np.random.Generator) -> list[Surface]:
    """A rim with spokes and a hub."""
    thick = rng.uniform(0.05, 0.18)
    parts = [_ring(1, thick), placed(rounded_box(np.array([0.15, 0.12, 0.15]), 0.08, 12))]
    for a in np.linspace(0, 2 * np.pi, int(rng.integers(3, 25)), endpoint=False):
        c, s = float(np.cos(a)), float(np.sin(a))
        parts.append(_rod([[0.1 * c, 0, 0.1 * s], [c, 0, s]], rng.uniform(0.02, 0.05)))
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    return [placed(part, turn=turn) for part in parts]


def _stool(rng: np.random.Generator) -> list[Surface]:
    """A seat on legs with rungs, a small table, a trivet."""
    high, wide = rng.uniform(0.4, 1.8), rng.uniform(0.4, 0.7)
    thick, legs = rng.uniform(0.03, 0.08), int(rng.integers(3, 5))
    parts = [placed(rounded_box(np.array([wide, 0.06, wide]), 0.05, 20), (0, high, 0))]
    angles = np.linspace(0, 2 * np.pi, legs, endpoint=False) + np.pi / 4
    feet = [(float(np.cos(a)), float(np.sin(a))) for a in angles]
    for (c, s), (c2, s2) in zip(feet, feet[1:] + feet[:1], strict=True):
        parts.append(_rod([[wide * c, 0, wide * s], [0.8 * wide * c, high, 0.8 * wide * s]], thick))
        y, r = 0.35 * high, 0.93 * wide
        parts.append(_rod([[r * c, y, r * s], [r * c2, y, r * s2]], 0.7 * thick))
    return parts
