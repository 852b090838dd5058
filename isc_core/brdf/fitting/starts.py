"""Where to look for lights: the peaks of the specular light as a function of the normal.

Problem: the least squares need a start near the light. For an orthographic view and a far light the lobe is highest near the normal that
equals the half vector, l = 2 (v . h) h - v.

Equation: normals are laid out on a disc by Lambert's equal-area map, (x, y) / sqrt(1 + z); the mean specular light of each cell, blurred
together with its number of pixels, has its maximum at h.

Citation: J. P. Snyder, "Map projections: a working manual", USGS Professional Paper 1395 (1987), doi:10.3133/pp1395.

Limits: normals that no pixel has are empty cells; cells are 3 degrees wide.
"""

import numpy as np
from scipy import ndimage

_CELLS = 41
_BLUR = 1.0  # cells


def brightest_half_vector(normal: np.ndarray, value: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The unit normal (3,) around which `value` (N,), which may be negative, is highest on the average; `normal` (N, 3), `weight` (N,)."""
    flat = normal[:, :2] / np.sqrt(1 + np.clip(normal[:, 2], 0, 1))[:, None]
    cell = np.clip(np.floor((flat + 1) / 2 * _CELLS).astype(int), 0, _CELLS - 1)
    index = cell[:, 0] * _CELLS + cell[:, 1]
    total = np.bincount(index, weight * value, _CELLS**2).reshape(_CELLS, _CELLS)
    count = np.bincount(index, weight, _CELLS**2).reshape(_CELLS, _CELLS)
    total, count = (ndimage.gaussian_filter(a, _BLUR, mode="constant") for a in (total, count))
    mean = total / (count + 0.05 * max(float(count.max()), 1e-300))
    best = np.unravel_index(int(np.argmax(mean)), mean.shape)
    near = np.exp(-((cell - best) ** 2).sum(axis=1) / (2 * (1.5 * _BLUR) ** 2)) * weight * np.maximum(value, 0)
    middle = near @ normal
    length = float(np.linalg.norm(middle))
    return middle / length if length > 0 else np.array([0.0, 0, 1])


def light_of_half_vector(half: np.ndarray) -> np.ndarray:
    """The direction (3,) of the light whose half vector with the view (0, 0, 1) is the unit vector `half` (3,)."""
    return 2 * half[2] * half - np.array([0.0, 0, 1])
