"""Starting directions of the lights: the peaks of the specular light as a function of the normal.

Problem: the least squares need a start near the light. For an orthographic view and a distant
light, the lobe has its maximum near the normal that equals the half vector, l = 2 (v . h) h - v.

Equation: normals are laid out on a disc by Lambert's equal-area map, (x, y) / sqrt(1 + z); the mean
specular light of each cell, blurred together with its number of pixels, has its maximum at h.

Citation: J. P. Snyder, "Map projections: a working manual", USGS Professional Paper 1395 (1987),
doi:10.3133/pp1395.

Limits: cells of normals that do not occur are empty; cells are 3 degrees wide.
"""

import numpy as np

from ..filters.gaussian import gaussian_average

_CELLS = 41
_BLUR, _MIN_DISTANCE = 1.0, 5.0  # cells


def bright_half_vectors(
    normal: np.ndarray, value: np.ndarray, weight: np.ndarray, count: int
) -> list[np.ndarray]:
    """Find the unit normals around which a value is highest on average.

    Parameters
    ----------
    normal : (N, 3) ndarray
        Unit normals.
    value : (N,) ndarray
        May be negative.
    weight : (N,) ndarray
        Of each pixel, >= 0.
    count : int
        Number of peaks.

    Returns
    -------
    list of (3,) ndarray
        The highest first; the last is the normal of the brightest pixel.
    """
    flat = normal[:, :2] / np.sqrt(1 + np.clip(normal[:, 2], 0, 1))[:, None]
    cell = np.clip(np.floor((flat + 1) / 2 * _CELLS).astype(int), 0, _CELLS - 1)
    index = cell[:, 0] * _CELLS + cell[:, 1]
    total = np.bincount(index, weight * value, _CELLS**2).reshape(_CELLS, _CELLS)
    number = np.bincount(index, weight, _CELLS**2).reshape(_CELLS, _CELLS)
    total, number = (gaussian_average(a, _BLUR, mirrored=False) for a in (total, number))
    mean = total / (number + 0.05 * max(float(number.max()), 1e-300))
    rows, columns = np.indices(mean.shape)
    found = []
    for _ in range(count - 1):
        best = np.unravel_index(int(np.argmax(mean)), mean.shape)
        near = (
            np.exp(-((cell - best) ** 2).sum(axis=1) / (2 * (1.5 * _BLUR) ** 2))
            * weight
            * np.maximum(value, 0)
        )
        middle = near @ normal
        length = float(np.linalg.norm(middle))
        if length > 0:
            found.append(middle / length)
        mean = np.where(
            (rows - best[0]) ** 2 + (columns - best[1]) ** 2 < _MIN_DISTANCE**2, -np.inf, mean
        )
    return [*found, normal[int(np.argmax(value * (weight > 0)))]]


def light_of_half_vector(half: np.ndarray) -> np.ndarray:
    """Compute the direction of the light whose half vector with the view (0, 0, 1) is given.

    Parameters
    ----------
    half : (3,) ndarray
        Unit half vector.

    Returns
    -------
    (3,) ndarray
        Unit vector toward the light.
    """
    return 2 * half[2] * half - np.array([0.0, 0, 1])
