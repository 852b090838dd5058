"""Areas with sharp edges, as on a painted toy, a cow or a mosaic.

Equation: each place takes the level of the nearest of some sites (G. Voronoi, 1908); places are
moved by noise first, so that borders bend. Other maps are cut by lines or are rectangles within
rectangles.
"""

import numpy as np
from scipy.spatial import cKDTree

from .canvas import FINER, Painting, averaged, filtered_noise, places


def patches(rng: np.random.Generator, side: int) -> Painting:
    """Draw areas of a few levels.

    Parameters
    ----------
    rng : numpy.random.Generator
    side : int

    Returns
    -------
    Painting
    """
    fine, style = FINER * side, rng.random()
    if style < 0.55:
        return Painting(averaged(_cells(rng, fine)), True)
    if style < 0.75:
        return Painting(averaged(_islands(rng, fine)), True)
    values = _cuts(rng, fine) if style < 0.88 else _rectangles(rng, fine)
    return Painting(averaged(values), False)


def _palette(rng: np.random.Generator, count: int) -> np.ndarray:
    """A level for each of `count` areas, two or more: two, four or any."""
    steps = rng.choice([1, 3, 255])
    levels = np.rint(rng.uniform(0, 1, count) * steps) / steps
    if np.ptp(levels) < 0.5:
        levels[int(rng.integers(count))] = levels.mean() < 0.5
    return np.asarray(levels)


def _cells(rng: np.random.Generator, fine: int) -> np.ndarray:
    x, y = places(fine)
    bend = rng.choice([0, rng.uniform(0.01, 0.06)])
    moved = np.stack(
        [place + bend * filtered_noise(rng, fine, rng.uniform(3.5, 5), 2) for place in (x, y)], -1
    )
    count = round(np.exp(rng.uniform(np.log(4), np.log(120))))
    sites = rng.random((count, 2))
    outlined = rng.random() < 0.35
    distance, nearest = cKDTree(sites, boxsize=1).query(moved % 1, k=2 if outlined else 1)
    levels = _palette(rng, count)
    if not outlined:
        return np.asarray(levels[nearest])
    line = distance[..., 1] - distance[..., 0] < rng.uniform(0.01, 0.04)
    ink = rng.choice([0, 1])
    return np.where(line, ink, levels[nearest[..., 0]] * 0.7 + 0.15)


def _islands(rng: np.random.Generator, fine: int) -> np.ndarray:
    """Smooth noise in a few levels: camouflage, cows, spilled paint."""
    values = filtered_noise(rng, fine, rng.uniform(4, 5.5), rng.uniform(1, 4))
    cuts = np.sort(rng.normal(0, 0.8, int(rng.integers(1, 5))))
    return np.asarray(_palette(rng, len(cuts) + 1)[np.searchsorted(cuts, values)])


def _cuts(rng: np.random.Generator, fine: int) -> np.ndarray:
    """Levels that change at straight or bent lines."""
    x, y = (place - 0.5 for place in places(fine))
    values = np.zeros((fine, fine), int)
    for k in range(int(rng.integers(1, 6))):
        angle, curve = rng.uniform(0, 2 * np.pi), rng.normal(0, 0.8)
        u, v = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        values += (u + curve * v * v > rng.uniform(-0.35, 0.35)) << k
    levels = _palette(rng, 64)
    levels[:2] = 0, 1
    return np.asarray(levels[values])


def _rectangles(rng: np.random.Generator, fine: int) -> np.ndarray:
    """A square that is cut in two again and again."""
    values = np.zeros((fine, fine))
    line = int(rng.choice([0, rng.integers(2, 12)]))
    todo = [(0, 0, fine, fine)]
    for _ in range(int(rng.integers(3, 16))):
        top, left, high, wide = todo.pop(int(np.argmax([h * w for *_, h, w in todo])))
        share = rng.uniform(0.3, 0.7)
        if high > wide:
            cut = int(high * share)
            todo += [(top, left, cut, wide), (top + cut, left, high - cut, wide)]
        else:
            cut = int(wide * share)
            todo += [(top, left, high, cut), (top, left + cut, high, wide - cut)]
    for level, (top, left, high, wide) in zip(_palette(rng, len(todo)), todo, strict=True):
        values[top + line : top + high, left + line : left + wide] = 0.1 + 0.9 * level
    return values
