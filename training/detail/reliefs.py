"""Height maps of fine relief, from a seed: noise, dents, cells, grooves, weaves, letters.

Problem: what a network takes for relief must not depend on what the relief is of. The atlas of
patterns that print is drawn from (`training.world.patterns`) is drawn from here too, as heights, so
that no letter and no thread tells paint from relief.

Citation: cells: S. Worley, "A cellular texture basis function", SIGGRAPH 1996,
doi:10.1145/237170.237267.

Limits: maps are scaled to slopes of root mean square 1; the patch chooses the amplitude.
"""

from collections.abc import Callable

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ..world.patterns import make_atlas
from ..world.patterns.canvas import filtered_noise
from ..world.random_draws import log_uniform

Drawn = Callable[[np.random.Generator, int], np.ndarray]


def _fractal(rng: np.random.Generator, side: int) -> np.ndarray:
    """Draw noise, of one scale or of many."""
    return filtered_noise(rng, side, rng.uniform(1.5, 5), log_uniform(rng, 4, side / 8))


def _brushed(rng: np.random.Generator, side: int) -> np.ndarray:
    """Draw noise that is longer along one axis."""
    least = log_uniform(rng, 4, side / 8)
    return filtered_noise(rng, side, rng.uniform(1.5, 4), least, (1, log_uniform(rng, 2, 12)))


def _cells(rng: np.random.Generator, side: int) -> np.ndarray:
    """Draw cells: hammered metal, pebbles, leather, tiles with grooves between them."""
    width = log_uniform(rng, 5, 32)
    points = rng.uniform(-width, side + width, (int((side / width + 2) ** 2), 2))
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1)
    near = cKDTree(points).query(places.reshape(-1, 2), k=2)[0].reshape(side, side, 2)
    kind = int(rng.integers(3))
    if kind == 0:
        return np.asarray(np.minimum(near[..., 0], width) ** 2 * rng.choice([-1, 1]))
    between = near[..., 1] - near[..., 0]
    if kind == 1:
        return np.asarray(np.minimum(between, width * rng.uniform(0.1, 0.6)))
    return np.asarray(np.sqrt(between + 1) * rng.choice([-1, 1]))


def _dents(rng: np.random.Generator, side: int) -> np.ndarray:
    """Draw scattered bumps or dents of like sizes."""
    width = log_uniform(rng, 1.5, 8)
    impulses = np.zeros((side, side))
    count = int(log_uniform(rng, 0.02, 0.4) * side**2 / width**2)
    rows, columns = rng.integers(0, side, (2, max(count, 4)))
    signs = rng.choice([-1, 1], len(rows)) if rng.random() < 0.3 else 1
    impulses[rows, columns] = signs * rng.uniform(0.3, 1, len(rows))
    return np.asarray(
        ndimage.gaussian_filter(impulses, width, mode="wrap") * rng.choice([-1.0, 1.0])
    )


def _ridges(rng: np.random.Generator, side: int) -> np.ndarray:
    """Draw parallel or warped ridges, round or with edges."""
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    angle, length = rng.uniform(0, np.pi), log_uniform(rng, 4, 40)
    warp = filtered_noise(rng, side, 4, 2) * rng.choice([0, log_uniform(rng, 0.3, 6)])
    wave = np.sin(2 * np.pi * (x * np.cos(angle) + y * np.sin(angle)) / length + warp)
    return np.asarray(np.tanh(wave * log_uniform(rng, 0.3, 3)))


_DRAWN: tuple[Drawn, ...] = (_fractal, _fractal, _brushed, _cells, _cells, _dents, _ridges)
_FROM_ATLAS = 0.4


def draw_reliefs(seed: int, count: int, side: int) -> np.ndarray:
    """Draw height maps.

    Parameters
    ----------
    seed : int
    count, side : int
        Number of maps, and their side in pixels.

    Returns
    -------
    (count, side, side) float32 ndarray
        Pixels toward the viewer; the slope of each map has a root mean square of 1.
    """
    patterns = make_atlas(seed + 1, max(int(count * _FROM_ATLAS), 1), side).maps
    maps = np.empty((count, side, side), np.float32)
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        if k < len(patterns):
            height = patterns[k] * rng.choice([-1.0, 1.0])
        else:
            height = _DRAWN[int(rng.integers(len(_DRAWN)))](rng, side)
        maps[k] = _unit_slope(ndimage.gaussian_filter(height, log_uniform(rng, 0.5, 2)))
    return maps


def _unit_slope(height: np.ndarray) -> np.ndarray:
    slope = np.gradient(height)
    size = float(np.sqrt(np.mean(slope[0] ** 2 + slope[1] ** 2)))
    return (height - height.mean()) / max(size, 1e-9)
