"""Shells and horns: snails, whelks, nautili, scallops, sea urchins, twisted pastry.

Equation: a spiral shell is a tube whose radius, distance from the axis and height all grow by a
factor a turn (Moseley's logarithmic spiral), with ribs and spines; a scallop is a fan of ribs on a
cap.

Citation: D. M. Raup 1966, Journal of Paleontology 40, 1178-1190 (geometry of coiled shells).
"""

from collections.abc import Callable

import numpy as np

from ..geometry.forms import ball, displaced, from_grid, placed, sheet
from ..geometry.noise import fractal
from ..geometry.surface import Surface


def make(rng: np.random.Generator) -> Surface:
    """Make a shell.

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
        _spiral,
        _spiral,
        _scallop,
        _urchin,
    )
    body = styles[int(rng.integers(len(styles)))](rng)
    return displaced(body, rng.uniform(0, 0.006) * fractal(body.vertices, 6, 2, 0.6, rng))


def _spiral(rng: np.random.Generator) -> Surface:
    turns, growth = rng.uniform(2.5, 6), rng.uniform(1.4, 3.0)
    t, a = np.meshgrid(np.linspace(0, turns, 420), np.linspace(0, 2 * np.pi, 65), indexing="ij")
    size = growth ** (t - turns)
    tall, away = rng.uniform(0, 3.5), rng.uniform(0.75, 1.1)
    ribs = 1 + rng.uniform(0, 0.1) * np.abs(np.sin(np.pi * t * rng.integers(4, 14)))
    ribs = ribs + rng.uniform(0, 0.06) * np.cos(a * rng.integers(5, 14))
    if rng.random() < 0.3:
        ribs = (
            ribs
            + 0.35 * np.exp(-((np.mod(a - 1, 2 * np.pi) / 0.3) ** 2)) * np.sin(np.pi * 7 * t) ** 8
        )
    out = size * (away + 0.8 * ribs * np.cos(a))
    height = size * (0.8 * rng.uniform(0.8, 1.4) * ribs * np.sin(a) - tall)
    angle = 2 * np.pi * t
    points = np.stack([out * np.cos(angle), height, out * np.sin(angle)], -1)
    inner = points[-1].mean(0) + 0.85 * (points[-1] - points[-1].mean(0))
    deep = points[-30].mean(0) + 0.7 * (points[-30] - points[-30].mean(0))
    tip = np.broadcast_to(points[0].mean(0), points[0].shape)
    end = np.broadcast_to(deep.mean(0), deep.shape)
    return from_grid(np.concatenate([tip[None], points, inner[None], deep[None], end[None]]))


def _scallop(rng: np.random.Generator) -> Surface:
    r, v = np.meshgrid(np.linspace(0.03, 1, 100), np.linspace(-1, 1, 150), indexing="ij")
    ribs, spread = int(rng.integers(6, 18)), rng.uniform(0.8, 1.4)
    angle = spread * v
    edge = 1 + 0.04 * np.cos(2 * np.pi * ribs * v) - 0.15 * v**4
    rib = rng.uniform(0.02, 0.05) * r * np.cos(2 * np.pi * ribs * v)
    rings = 0.01 * np.sin(r * rng.uniform(30, 70)) * r
    dome = rng.uniform(0.25, 0.5) * np.sqrt(
        np.clip(np.sin(np.pi * r**0.7) * (1 - 0.9 * v**4), 0, 1)
    )
    points = np.stack([r * edge * np.sin(angle), r * edge * np.cos(angle), dome + rib + rings], -1)
    return sheet(points, 0.03)


def _urchin(rng: np.random.Generator) -> Surface:
    """A sea urchin's shell: knobs in rows between the poles."""
    base = ball(66)
    d = base.vertices
    polar, angle = np.arccos(np.clip(d[:, 1], -1, 1)), np.arctan2(d[:, 0], d[:, 2])
    rows, levels = 2 * int(rng.integers(5, 11)), int(rng.integers(8, 20))
    knobs = np.abs(np.sin(rows * angle / 2)) * np.abs(np.sin(levels * polar))
    knobs = np.clip(knobs - 0.55, 0, 1) * np.sin(polar)
    lobes = 0.05 * np.abs(np.sin(5 * angle / 2)) * np.sin(polar)
    hole = -0.25 * np.exp(-((polar / 0.2) ** 2))
    flat = np.array([1, rng.uniform(0.5, 0.9), 1])
    return displaced(placed(base, scale=flat), rng.uniform(0.1, 0.3) * knobs + lobes + hole)
