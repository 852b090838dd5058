"""The direction of one distant light from an image of a convex diffuse object of one albedo (Zheng
& Chellappa 1991).

Problem: E = max(0, n . l) with unknown n; find l, whose length is albedo times strength.

Equation: brightness grows toward the light, so the tilt is the direction of the mean unit gradient
of E. The ratio of the mean brightness to its root mean square depends on the slant alone once the
distribution of the normals is known; here it is that of a sphere, attached shadow included. The
length follows from the mean brightness.

Citation: Q. Zheng and R. Chellappa, "Estimation of illuminant direction, albedo, and shape from
shading", IEEE TPAMI 13(7), 680-702 (1991), doi:10.1109/34.85658.

Limits: one light, one albedo, a rounded object: a shallow relief does not have the normals of a
sphere, and texture biases the slant.
"""

from functools import cache

import numpy as np
from scipy import ndimage

_SLANTS = np.deg2rad(np.arange(0.0, 81.0))


def estimate_light(brightness: np.ndarray, mask: np.ndarray, smoothing: float = 1.0) -> np.ndarray:
    """Estimate the light vector.

    Parameters
    ----------
    brightness : (H, W) ndarray
        Linear, >= 0.
    mask : (H, W) bool ndarray
        Not empty.
    smoothing : float
        Sigma in pixels of the Gaussian before gradients are taken.

    Returns
    -------
    (3,) ndarray
        Camera frame; its length is in units of `brightness`. A frontal light where there are no
        gradients.
    """
    inside = brightness[mask].astype(float)
    mean, power = float(inside.mean()), float(np.mean(inside**2))
    if mean <= 0:
        return np.array([0.0, 0.0, 1.0])
    tilt = _tilt(brightness, mask, smoothing)
    means, ratios = _sphere()
    # Ratios decrease with the slant; `interp` needs increasing ones.
    slant = (
        float(np.interp(mean / np.sqrt(power), ratios[::-1], _SLANTS[::-1]))
        if np.hypot(*tilt) > 0
        else 0.0
    )
    length = mean / float(np.interp(slant, _SLANTS, means))
    return length * np.array([np.sin(slant) * tilt[0], np.sin(slant) * tilt[1], np.cos(slant)])


def _tilt(brightness: np.ndarray, mask: np.ndarray, smoothing: float) -> np.ndarray:
    """Unit vector (x right, y up) of the mean unit gradient, or zero.

    Pixels whose window extends beyond the mask are ignored.
    """
    filled = np.where(mask, brightness, 0).astype(float)
    down, right = (
        ndimage.gaussian_filter(filled, smoothing, order=order) for order in ((1, 0), (0, 1))
    )
    core = ndimage.binary_erosion(mask, iterations=int(np.ceil(4 * smoothing)) + 1)
    gradient = np.stack([right[core], -down[core]], axis=1)
    length = np.hypot(gradient[:, 0], gradient[:, 1])
    gradient = gradient[length > 1e-9 * max(float(filled.max()), 1e-30)]
    if not len(gradient):
        return np.zeros(2)
    mean = (gradient / np.hypot(gradient[:, :1], gradient[:, 1:])).mean(axis=0)
    size = float(np.hypot(*mean))
    return mean / size if size > 1e-6 else np.zeros(2)


@cache
def _sphere() -> tuple[np.ndarray, np.ndarray]:
    """Mean brightness of a unit sphere's visible half, and its ratio to the root mean square, for
    each of `_SLANTS`.
    """
    x, y = np.meshgrid(*[np.linspace(-1, 1, 201)] * 2)
    visible = x**2 + y**2 < 1
    x, z = x[visible], np.sqrt(1 - x[visible] ** 2 - y[visible] ** 2)
    shades = [np.maximum(0, np.sin(s) * x + np.cos(s) * z) for s in _SLANTS]
    means = np.array([shade.mean() for shade in shades])
    return means, means / np.sqrt([np.mean(shade**2) for shade in shades])
