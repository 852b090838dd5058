"""Crumpled and folded paper: balls and sheets with sharp creases.

Equation: a fold turns what lies beyond a line of the sheet about that line, which keeps lengths.
Crumpling adds piecewise linear noise (`facets`) of several scales to the height of a sheet or the
radius of a ball: flat facets between sharp creases.

Limits: creases are as sharp as the grid, and self-intersections are not prevented.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.forms import ball, displaced, sheet
from ..geometry.noise import facets
from ..geometry.surface import Surface


def make(rng: np.random.Generator) -> Surface:
    """Make a crumpled ball, a crumpled sheet or a folded sheet.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    style = rng.random()
    if style < 0.45:
        return _crumpled_ball(rng)
    flat = _flat(rng)
    points = _crumpled(flat, rng) if style < 0.75 else _folded(flat, rng)
    surface = sheet(points, rng.uniform(0.008, 0.02))
    turn = Rotation.from_euler("yx", [rng.uniform(0, 360), rng.uniform(-70, 20)], degrees=True)
    return Surface(surface.vertices @ turn.as_matrix().T, surface.faces)


def _flat(rng: np.random.Generator, count: int = 110) -> np.ndarray:
    side = np.linspace(-1, 1, count)
    x, y = np.meshgrid(side, rng.uniform(0.6, 1.0) * side[::-1])
    return np.stack([x, y, 0 * x], -1)


def _creases(
    points: np.ndarray, spacing: float, count: int, rng: np.random.Generator
) -> np.ndarray:
    """Facets of `count` scales, each half as large and deep as the one before."""
    return np.asarray(
        sum(0.5**k * facets(points, spacing * 0.5**k, rng) for k in range(count)), float
    )


def _crumpled_ball(rng: np.random.Generator) -> Surface:
    base = ball(70)
    d = base.vertices
    spacing = rng.uniform(0.4, 0.8)
    radius = 1 + rng.uniform(0.07, 0.16) * _creases(d, spacing, 3, rng)
    body = Surface(d * np.clip(radius, 0.4, 1.6)[:, None] * rng.uniform(0.7, 1.1, 3), base.faces)
    return displaced(body, 0.02 * facets(body.vertices, 0.25, rng))


def _crumpled(flat: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A sheet that was crumpled and opened again."""
    plane = flat[..., :2]
    depth = 10 ** rng.uniform(-1.8, -0.9)
    z = depth * _creases(flat.reshape(-1, 3), rng.uniform(0.3, 0.6), 3, rng)
    bow = rng.normal(0, 0.25, 2)
    height = z.reshape(plane.shape[:2]) + (plane**2) @ bow
    return np.concatenate([plane, height[..., None]], -1)


def _folded(flat: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A sheet folded a few times about lines, each time all that lies beyond the line."""
    rest, points = flat[..., :2], flat.copy()
    for _ in range(int(rng.integers(1, 4))):
        angle = rng.choice([0, 90, 45, 135]) + rng.normal(0, 6)
        normal = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
        beyond = rest @ normal > rng.uniform(-0.4, 0.5)
        degrees = rng.uniform(25, 150) * rng.choice([-1, 1])
        if 0.02 < beyond.mean() < 0.98:
            points = _turned(rest, points, beyond, normal, degrees)
    points[..., 2] += 0.015 * _creases(flat.reshape(-1, 3), 0.5, 2, rng).reshape(rest.shape[:2])
    return points


def _turned(
    rest: np.ndarray,
    points: np.ndarray,
    beyond: np.ndarray,
    normal: np.ndarray,
    degrees: float,
) -> np.ndarray:
    """Turn the points `beyond` about the line on which they border, as the sheet lies now."""
    along = rest @ normal
    edge = beyond & (along < along[beyond].min() + 0.03)
    axis_points = points[edge]
    centre = axis_points.mean(0)
    axis = np.linalg.svd(axis_points - centre, full_matrices=False)[2][0]
    turn = Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()
    turned = points.copy()
    turned[beyond] = (points[beyond] - centre) @ turn.T + centre
    return turned
