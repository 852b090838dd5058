"""Fruit and vegetables: apples, pears, potatoes, peppers, pumpkins, citrus, berries, bananas.

Equation: a ball's directions become radius and height by a profile of the polar angle, times lobes
of the azimuth, plus dimples at the poles; then fine displacement: pores, seeds on a Fibonacci
lattice, ridges. Some have a stem, calyx or leaf.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..geometry.forms import ball, curve, displaced, placed, sheet, tube
from ..geometry.noise import cells, fractal, noise
from ..geometry.surface import Surface, together


def make(rng: np.random.Generator) -> Surface:
    """Make a fruit or vegetable.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    kinds: tuple[Callable[[np.random.Generator], Surface], ...] = (
        _apple,
        _pear,
        _potato,
        _pepper,
        _ribbed,
        _citrus,
        _berry,
        _long,
        _nut,
    )
    body = kinds[int(rng.integers(len(kinds)))](rng)
    tilt = Rotation.from_euler("xyz", rng.normal(0, 15, 3), degrees=True).as_matrix()
    return placed(body, turn=tilt)


def _polar(ball_: Surface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions, polar angle from the top, and azimuth of the vertices of a ball."""
    d = ball_.vertices
    return d, np.arccos(np.clip(d[:, 1], -1, 1)), np.arctan2(d[:, 0], d[:, 2])


def _around(faces: np.ndarray, radius: np.ndarray, height: np.ndarray, d: np.ndarray) -> Surface:
    """A body from radius and height of each vertex, in the direction's azimuth."""
    flat = d[:, [0, 2]] / np.maximum(np.linalg.norm(d[:, [0, 2]], axis=1, keepdims=True), 1e-9)
    x, z = (radius[:, None] * flat).T
    return Surface(np.stack([x, height, z], -1), faces)


def _uneven(body: Surface, amount: float, rng: np.random.Generator) -> Surface:
    return displaced(body, amount * noise(body.vertices, 0.9, rng))


def _stem(top: float, length: float, width: float, rng: np.random.Generator) -> Surface:
    bend = rng.normal(0, 0.35 * length, 2)
    points = np.array(
        [[0, top - 0.1, 0], [0, top + 0.4 * length, 0], [bend[0], top + length, bend[1]]]
    )
    radius = width * np.linspace(1, rng.uniform(0.9, 1.6), 14)
    return tube(curve(points, 14), radius, 10)


def _apple(rng: np.random.Generator) -> Surface:
    base = ball()
    d, t, p = _polar(base)
    lobes = 1 + rng.uniform(0.01, 0.05) * np.cos(5 * p) * np.clip(-d[:, 1], 0, 1)
    radius = np.sin(t) * (1 + rng.uniform(0.02, 0.2) * np.cos(t)) * lobes
    top, bottom = rng.uniform(0.25, 0.5), rng.uniform(0.1, 0.3)
    height = rng.uniform(0.8, 1.0) * np.cos(t)
    height -= top * np.exp(-((t / rng.uniform(0.25, 0.45)) ** 2))
    height += bottom * np.exp(-(((np.pi - t) / 0.3) ** 2)) * lobes
    body = _uneven(_around(base.faces, radius, height, d), rng.uniform(0.0, 0.04), rng)
    parts = [body]
    if rng.random() < 0.8:
        start = float(body.vertices[np.argmax(d[:, 1]), 1])
        parts.append(_stem(start, rng.uniform(0.3, 0.6), rng.uniform(0.03, 0.05), rng))
    if rng.random() < 0.3:
        parts.append(_leaf(start=np.array([0, 0.75, 0.0]), size=rng.uniform(0.4, 0.8), rng=rng))
    return together(parts)


def _leaf(start: np.ndarray, size: float, rng: np.random.Generator) -> Surface:
    u, v = np.meshgrid(np.linspace(0, 1, 40), np.linspace(-1, 1, 21), indexing="ij")
    width = 0.3 * np.sin(np.pi * u**0.8) + 0.01
    points = np.stack([v * width, 0.12 * np.abs(v) + 0.4 * u - 0.5 * u**2, u], -1) * size
    turn = Rotation.from_euler("y", rng.uniform(0, 360), degrees=True).as_matrix()
    return placed(sheet(points, 0.015 * size), start, turn=turn)


def _pear(rng: np.random.Generator) -> Surface:
    base = ball()
    d, t, _ = _polar(base)
    y = d[:, 1]
    neck = 1 / (1 + np.exp(-(y - rng.uniform(0.0, 0.35)) * rng.uniform(4, 8)))
    radius = np.sin(t) * (1 - rng.uniform(0.35, 0.6) * neck)
    height = y * (1 + rng.uniform(0.2, 0.7) * (y > 0))
    height += 0.18 * np.exp(-(((np.pi - t) / 0.25) ** 2)) - 0.1 * np.exp(-((t / 0.2) ** 2))
    body = _uneven(_around(base.faces, radius, height, d), rng.uniform(0.02, 0.07), rng)
    body = displaced(body, rng.uniform(0, 0.003) * fractal(body.vertices, 6, 3, 0.5, rng))
    start = float(body.vertices[np.argmax(y), 1])
    return together([body, _stem(start, rng.uniform(0.25, 0.5), 0.045, rng)])


def _potato(rng: np.random.Generator) -> Surface:
    base = ball()
    body = placed(base, scale=np.array([rng.uniform(1, 1.7), 1, rng.uniform(0.8, 1.1)]))
    body = displaced(body, rng.uniform(0.06, 0.16) * fractal(base.vertices, 1.1, 2, 0.4, rng))
    nearest, _ = cells(body.vertices, rng.uniform(0.5, 0.9), rng)
    eyes = -0.05 * np.exp(-((nearest / 0.13) ** 2))
    skin = rng.uniform(0.001, 0.005) * fractal(body.vertices, 4, 4, 0.6, rng)
    return displaced(body, eyes + skin)


def _pepper(rng: np.random.Generator) -> Surface:
    base = ball()
    d, t, p = _polar(base)
    lobes, deep = int(rng.integers(3, 5)), rng.uniform(0.08, 0.22)
    wave = 1 - deep * (1 - np.abs(np.cos(lobes * p / 2))) ** 1.5
    radius = np.sin(t) ** 0.7 * (0.75 + 0.2 * d[:, 1]) * wave
    height = rng.uniform(0.8, 1.4) * np.cos(t)
    height -= 0.35 * np.exp(-((t / 0.35) ** 2)) - 0.3 * np.exp(-(((np.pi - t) / 0.4) ** 2)) * wave
    body = _uneven(_around(base.faces, radius, height, d), 0.05, rng)
    start = float(body.vertices[np.argmax(d[:, 1]), 1])
    return together([body, _stem(start, 0.5, 0.09, rng)])


def _ribbed(rng: np.random.Generator) -> Surface:
    base = ball()
    d, t, p = _polar(base)
    ribs, deep = int(rng.integers(5, 14)), rng.uniform(0.05, 0.18)
    wave = 1 - deep * (1 - np.abs(np.cos(ribs * p / 2))) ** rng.uniform(1, 2.5)
    radius = np.sin(t) * wave
    height = rng.uniform(0.55, 0.95) * np.cos(t) * (1 + deep * (wave - 1))
    height -= rng.uniform(0.15, 0.4) * np.exp(-((t / 0.4) ** 2))
    height += 0.2 * np.exp(-(((np.pi - t) / 0.4) ** 2))
    body = _uneven(_around(base.faces, radius, height, d), rng.uniform(0.0, 0.05), rng)
    body = displaced(body, rng.uniform(0, 0.004) * fractal(body.vertices, 6, 3, 0.5, rng))
    start = float(body.vertices[np.argmax(d[:, 1]), 1])
    return together([body, _stem(start, rng.uniform(0.2, 0.5), rng.uniform(0.06, 0.12), rng)])


def _citrus(rng: np.random.Generator) -> Surface:
    base = ball()
    d, t, _ = _polar(base)
    tip, width = rng.uniform(0, 0.35), 0.3
    height = np.cos(t) * rng.uniform(0.9, 1.25)
    height += tip * (np.exp(-((t / width) ** 2)) - 0.7 * np.exp(-(((np.pi - t) / width) ** 2)))
    body = _uneven(_around(base.faces, np.sin(t), height, d), rng.uniform(0.0, 0.04), rng)
    nearest, _ = cells(body.vertices, rng.uniform(0.07, 0.12), rng)
    pores = -rng.uniform(0.004, 0.012) * np.exp(-((nearest / 0.3) ** 2))
    return displaced(body, pores + 0.006 * fractal(body.vertices, 4, 2, 0.5, rng))


def _fibonacci(count: int) -> np.ndarray:
    """Directions (count, 3), evenly spread in spirals."""
    k = np.arange(count) + 0.5
    y, turn = 1 - 2 * k / count, k * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - y**2)
    return np.stack([radius * np.sin(turn), y, radius * np.cos(turn)], -1)


def _berry(rng: np.random.Generator) -> Surface:
    base = ball()
    d, t, _ = _polar(base)
    count = int(rng.integers(60, 260))
    distance, _ = cKDTree(_fibonacci(count)).query(d)
    near = distance / np.sqrt(4 * np.pi / count)  # in spacings
    drupelets = rng.random() < 0.5
    relief = (
        rng.uniform(0.08, 0.16) * np.sqrt(np.clip(1 - 2.2 * near**2, 0, 1))
        if drupelets
        else -0.06 * np.exp(-((near / 0.3) ** 2)) + 0.035 * np.exp(-((near / 0.13) ** 2))
    )
    taper = 1 - rng.uniform(0.0, 0.5) * (1 - d[:, 1]) / 2
    body = _around(base.faces, np.sin(t) * taper, rng.uniform(0.9, 1.4) * np.cos(t), d)
    body = displaced(_uneven(body, 0.04, rng), relief)
    leaves = [
        _leaf(np.array([0, body.vertices[:, 1].max() - 0.03, 0]), 0.6, rng)
        for _ in range(int(rng.integers(0, 7)))
    ]
    return together([body, *leaves])


def _long(rng: np.random.Generator) -> Surface:
    """A banana, carrot, cucumber or chilli."""
    u = np.linspace(0, 1, 120)
    angle = rng.uniform(0.2, 1.8) * (u - 0.5)
    path = np.stack([np.sin(angle), 1 - np.cos(angle), 0 * u], -1) / max(np.ptp(angle), 0.3) * 2
    taper = rng.uniform(0, 0.8)
    swell = np.minimum(1, 6 * u + 0.25) * np.minimum(1, 5 * (1 - u) + 0.2)
    radius = rng.uniform(0.14, 0.28) * swell * (1 - taper * u)
    body = tube(path, radius, 72)
    angle_around = np.arctan2(body.vertices[:, 2], body.vertices[:, 1])
    edges = rng.uniform(0, 0.02) * np.cos(5 * angle_around)
    rings = rng.uniform(0, 0.012) * noise(body.vertices * (9, 0.5, 0.5), 1.5, rng)
    return displaced(body, edges + rings + 0.02 * noise(body.vertices, 1.5, rng))


def _nut(rng: np.random.Generator) -> Surface:
    """A walnut, a kernel or a truffle: ridges."""
    base = ball()
    body = placed(base, scale=np.array([1, rng.uniform(0.9, 1.3), rng.uniform(0.8, 1)]))
    field = fractal(body.vertices, rng.uniform(1.5, 3), 3, 0.5, rng)
    ridges = rng.uniform(0.05, 0.12) * (1 - np.abs(field)) - 0.05
    seam = 0.08 * np.exp(-((base.vertices[:, 2] / 0.07) ** 2))
    return displaced(_uneven(body, 0.05, rng), ridges + (rng.random() < 0.5) * seam)
