"""Soft packages: tea bags, sachets, crisp bags, sacks, wrapped sweets, gloves.

Equation: two sheets joined along a flat, crimped seam and blown up between: the thickness is a
power of the distance to the seam, and wrinkles (noise stretched across the seam) grow toward it.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.forms import ball, curve, displaced, from_grid, placed, rounded_box, tube
from ..geometry.noise import facets, fractal, noise
from ..geometry.surface import Surface, together


def make(rng: np.random.Generator) -> Surface:
    """Make a soft package.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up, its front toward z.
    """
    styles: tuple[Callable[[np.random.Generator], list[Surface]], ...] = (_bag, _bag, _sack, _sweet)
    parts = styles[int(rng.integers(len(styles)))](rng)
    turn = Rotation.from_euler("xyz", rng.normal(0, 15, 3), degrees=True).as_matrix()
    return together([placed(part, turn=turn) for part in parts])


def _bag(rng: np.random.Generator) -> list[Surface]:
    """A tea bag or sachet, with a string and a label at times."""
    side = np.linspace(-1, 1, 100)
    x, y = np.meshgrid(side, side)
    tall, seam = rng.uniform(0.8, 1.5), rng.uniform(0.04, 0.12)
    inside = np.clip((1 - np.maximum(np.abs(x), np.abs(y))) / seam - 1, 0, None) * seam
    fill = (np.clip(1 - x**2, 0, 1) * np.clip(1 - y**2, 0, 1)) ** 0.6 * (inside > 0)
    fill *= rng.uniform(0.2, 0.5) * np.minimum(1, inside / 0.15) ** 0.5
    flat = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    wrinkle = noise(flat * (1, 0.35, 1), rng.uniform(3, 6), rng).reshape(x.shape)
    crease = facets(flat, rng.uniform(0.3, 0.6), rng).reshape(x.shape)
    edge = np.exp(-inside / 0.2)
    shift = 0.03 * wrinkle * edge + rng.uniform(0, 0.05) * noise(flat, 0.8, rng).reshape(x.shape)
    crimp = 0.012 * np.sin(60 * x + 0 * y) * (inside <= 0)
    half = 0.006 + fill * (1 + 0.12 * crease) + 0.03 * np.abs(wrinkle) * edge * (inside > 0)
    pull = 1 - 0.12 * fill.max() * (
        1 - np.abs(y[..., None] * (0, 1) + x[..., None] * (1, 0))[..., ::-1] ** 2
    )
    plane = np.stack([x, tall * y], -1) * pull
    front = np.concatenate([plane, (shift + crimp + half)[..., None]], -1)
    back = np.concatenate([plane, (shift + crimp - half)[..., None]], -1)
    loop = np.concatenate([front, back[:, ::-1], front[:, :1]], axis=1)
    parts = [from_grid(loop)]
    if rng.random() < 0.6:
        u = rng.normal(0, 0.4, 3)
        string = np.array([[0, 0.97 * tall, 0], [u[0], 1.3 * tall, 0.1], [u[1], 1.5 * tall, u[2]]])
        parts.append(tube(curve(string, 60), np.full(60, 0.016), 8))
        label = placed(rounded_box(np.array([0.25, 0.25, 0.012]), 0.01, 12), string[-1])
        parts.append(label)
    return parts


def _sack(rng: np.random.Generator) -> list[Surface]:
    """A filled sack, tied at the neck."""
    base = ball(66)
    d = base.vertices
    y, angle = d[:, 1], np.arctan2(d[:, 0], d[:, 2])
    neck, count = rng.uniform(0.45, 0.7), int(rng.integers(8, 20))
    narrow = 1 - rng.uniform(0.6, 0.8) * np.exp(-(((y - neck) / 0.16) ** 2))
    folds = np.clip((y - neck + 0.6) / 0.6, 0, 1) * 0.14
    wave = 1 + folds * np.sin(count * angle + 2 * noise(d, 1, rng))
    flare = 1 + 0.8 * np.clip(y - neck, 0, 1)
    radius = np.sqrt(np.clip(1 - np.minimum(y, neck) ** 2, 0.05, 1)) * narrow * wave * flare
    flat = d[:, [0, 2]] / np.maximum(np.linalg.norm(d[:, [0, 2]], axis=1, keepdims=True), 1e-9)
    radius = radius * np.clip(np.hypot(d[:, 0], d[:, 2]) * 3, 0, 1)
    height = np.where(y < neck, np.maximum(y, -0.75), neck + 1.6 * (y - neck))
    body = Surface(np.stack([radius * flat[:, 0], height, radius * flat[:, 1]], -1), base.faces)
    body = displaced(body, rng.uniform(0.01, 0.05) * fractal(body.vertices, 1.5, 3, 0.5, rng))
    u = np.linspace(0, 2 * np.pi, 40)
    around = 0.34 * np.stack([np.cos(u), 0 * u, np.sin(u)], -1) + (0, neck, 0)
    return [body, tube(around, np.full(40, 0.05), 12)]


def _sweet(rng: np.random.Generator) -> list[Surface]:
    """A wrapped sweet: a core, twisted and fanned at both ends."""
    u, a = np.meshgrid(np.linspace(-1, 1, 150), np.linspace(0, 2 * np.pi, 121), indexing="ij")
    core, count = rng.uniform(0.3, 0.45), int(rng.integers(5, 12))
    out = np.clip((np.abs(u) - core) / (1 - core), 0, 1)
    belly = 0.3 * np.sqrt(np.clip(1 - (u / (core * 1.15)) ** 4, 0, 1))
    fan = 0.05 + 0.32 * np.clip(out - 0.15, 0, 1)
    radius = np.maximum(belly, fan * (out > 0))
    twist = a + rng.uniform(1, 3) * out * np.sign(u)
    pleat = 1 + np.clip(2.5 * out, 0, 0.6) * np.sin(count * twist)
    places = np.stack([u, radius * pleat * np.cos(a), radius * pleat * np.sin(a)], -1)
    ends = [np.broadcast_to(places[k].mean(0), places[k].shape)[None] for k in (0, -1)]
    body = from_grid(np.concatenate([ends[0], places, ends[1]]))
    return [displaced(body, 0.012 * facets(body.vertices, 0.2, rng))]
