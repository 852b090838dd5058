"""Cloth draped over obstacles, by position-based dynamics.

Equation: the cloth is a grid of points; each step moves them by inertia and gravity, then restores
the lengths of the links between neighbours (along, across, diagonal, and to the second neighbour
for bending), each by a part of the error at both ends, and pushes points out of the obstacles
below. A coarse grid settles first, then a fine one.

Citation: M. Mueller et al. 2007, doi:10.1016/j.jvcir.2007.01.005 (position-based dynamics).

Limits: no collision of the cloth with itself; obstacles are spheres, boxes, upright ellipsoids and
the floor.
"""

import numpy as np
from scipy.ndimage import zoom

from ..geometry.forms import sheet
from ..geometry.noise import fractal
from ..geometry.surface import Surface

_COARSE, _FINE = 44, 96  # points a side, first and in the end
_STEPS, _FINE_STEPS, _ROUNDS = 130, 18, 6
_GRAVITY, _DAMPING, _FLOOR = -0.0012, 0.98, -1.1
_SLIP = 0.3  # of a point's speed, left where it touches
# Steps to the partner of each link, and how much of its error is mended.
_LINKS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, 0.6), (1, -1, 0.6), (0, 2, 0.25), (2, 0, 0.25))
_MENDED = 0.42  # of a link's error a round, at each end: more of it does not converge


def make(rng: np.random.Generator) -> Surface:
    """Make a cloth that hangs over one to three obstacles, or is pinned at a few points.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.

    Returns
    -------
    Surface
        y up.
    """
    side = np.linspace(-1, 1, _COARSE)
    x, z = np.meshgrid(side * rng.uniform(0.7, 1), side)
    points = np.stack([x, 0.62 + 0 * x, z], -1)
    points += 0.01 * fractal(points.reshape(-1, 3), 2, 3, 0.7, rng).reshape(x.shape)[..., None]
    obstacles = [_obstacle(rng, k) for k in range(int(rng.integers(1, 4)))]
    pinned = np.zeros(x.shape, bool)
    if rng.random() < 0.3:
        obstacles = []
        for _ in range(int(rng.integers(2, 5))):
            i, j = rng.integers(0, _COARSE, 2)
            pinned[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] = True
    coarse = _settled(points, points, obstacles, pinned, _STEPS)
    grow = _FINE / _COARSE
    fine, rest = (zoom(one, (grow, grow, 1), order=3, mode="nearest") for one in (coarse, points))
    pins = zoom(pinned.astype(float), grow, order=0) > 0.5
    fine = _settled(fine, rest, obstacles, pins, _FINE_STEPS)
    weave = 0.0015 * fractal(fine.reshape(-1, 3), 10, 2, 0.6, rng).reshape(fine.shape[:2])
    return sheet(fine + weave[..., None] * (0, 1, 0), rng.uniform(0.01, 0.03))


def _obstacle(rng: np.random.Generator, number: int) -> tuple[str, np.ndarray, np.ndarray]:
    """Kind, centre and size of an obstacle below; the first one is large, and in the middle."""
    spread = 0.12 if number == 0 else 0.45
    x, z = rng.normal(0, spread, 2)
    size = rng.uniform(0.3, 0.55, 3) if number == 0 else rng.uniform(0.12, 0.35, 3)
    centre = np.array([x, rng.uniform(-0.35, 0.0), z])
    return str(rng.choice(["ball", "box", "egg"])), centre, size


def _settled(
    points: np.ndarray,
    rest: np.ndarray,
    obstacles: list[tuple[str, np.ndarray, np.ndarray]],
    pinned: np.ndarray,
    steps: int,
) -> np.ndarray:
    """Points after some steps, from their places and those that define the links' lengths."""
    before, start = points.copy(), points.copy()
    links = [
        (dy, dx, give, np.linalg.norm(np.subtract(*_ends(rest, dy, dx)), axis=-1))
        for dy, dx, give in _LINKS
    ]
    for _ in range(steps):
        moved = points + _DAMPING * (points - before)
        moved[..., 1] += _GRAVITY
        before, points = points, moved
        for _ in range(_ROUNDS):
            _mend(points, links)
            points[pinned] = start[pinned]
        free = points.copy()
        for kind, centre, size in obstacles:
            _push_out(points, kind, centre, size)
        points[..., 1] = np.maximum(points[..., 1], _FLOOR)
        touching = (free != points).any(-1)
        before[touching] = points[touching] + _SLIP * (before - points)[touching]
    return points


def _mend(points: np.ndarray, links: list[tuple[int, int, float, np.ndarray]]) -> None:
    """Bring the links nearer to their lengths, in place."""
    for dy, dx, give, rest in links:
        first, second = _ends(points, dy, dx)
        away = second - first
        length = np.sqrt(np.einsum("ijk,ijk->ij", away, away)) + 1e-9
        mend = (0.5 * _MENDED * give * (1 - rest / length))[..., None] * away
        first += mend
        second -= mend


def _ends(points: np.ndarray, dy: int, dx: int) -> tuple[np.ndarray, np.ndarray]:
    """Views of both ends of all links of one kind."""
    rows, columns = points.shape[:2]
    if dx < 0:
        return points[: rows - dy, -dx:], points[dy:, : columns + dx]
    return points[: rows - dy, : columns - dx], points[dy:, dx:]


def _push_out(points: np.ndarray, kind: str, centre: np.ndarray, size: np.ndarray) -> None:
    """Move points out of an obstacle, in place."""
    away = points - centre
    if kind == "box":
        depth = size - np.abs(away)
        axis = np.argmin(depth, -1)
        inside = (depth > 0).all(-1)
        move = np.zeros_like(points)
        step = np.take_along_axis(depth * np.sign(away), axis[..., None], -1)
        np.put_along_axis(move, axis[..., None], step, -1)
        points[inside] += move[inside]
        return
    if kind == "egg":
        away = away * (1, 0.5, 1)  # upright and twice as high, like a bottle
    length = np.linalg.norm(away, axis=-1, keepdims=True) + 1e-9
    inside = length[..., 0] < size[0]
    move = away * (size[0] / length - 1)
    points[inside] += (move / (1, 0.5, 1) if kind == "egg" else move)[inside]
