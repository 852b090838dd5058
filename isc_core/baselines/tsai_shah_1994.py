"""Shape from shading by a local linear approximation in the height (Tsai & Shah 1994).

Problem: E = R(p, q) = max(0, n . l), with slopes p, q taken as differences of neighbouring heights.

Equation: E - R is a function of each pixel's own height once its neighbours are fixed, and a damped
Newton step solves it, all pixels at once:
  z <- z + R' (E - R) / (W + R'^2),   R' = dR/dz,   starting at z = 0.

Citation: P.-S. Tsai and M. Shah, "Shape from shading using linear approximation", Image and Vision
Computing 12(8), 487-498 (1994), doi:10.1016/0262-8856(94)90002-7. There are two changes.
Differences are taken toward the neighbours on the side away from the light, so that both slopes
affect R with the same sign; with a fixed direction, R' vanishes for lights from one diagonal. And
the damping is constant, since the published gain decreases with every step and vanishes before
distant pixels are consistent.

Limits: local, so noise directly affects the height, and convex and concave shapes are distinguished
only by the start, which makes bright pixels high; insensitive under frontal light, where a flat
surface has R' = 0 (the light is then tilted by `min_slant`).
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from .box import Box
from .from_shading import BaselineEstimate, from_log_shading, grey_log_shading


@dataclass(frozen=True)
class TsaiShah1994Options:
    """Options of the estimate of the height.

    Attributes
    ----------
    steps : float
        Newton steps per pixel of the object's longer side, > 0, since changes propagate by one
        pixel per step.
    damping : float
        W, > 0; larger is slower and less sensitive to noise.
    min_slant : float
        Smallest sine of the angle between light and line of sight, in (0, 1).
    smoothing : float
        Sigma of the Gaussian filter of the final height, as a fraction of the square root of the
        object's area; 0 for none.
    """

    steps: float = 1.6
    damping: float = 0.5
    min_slant: float = 0.05
    smoothing: float = 0.03


def estimate(
    log_image: np.ndarray, mask: np.ndarray, options: TsaiShah1994Options | None = None
) -> BaselineEstimate:
    """Estimate shape and light of an object of one albedo: all its brightness is shading.

    Parameters
    ----------
    log_image : (H, W, 3) ndarray
        Natural logarithm of a linear image, finite in the mask.
    mask : (H, W) bool ndarray
    options : TsaiShah1994Options, optional

    Returns
    -------
    BaselineEstimate

    Raises
    ------
    InputError
        If the mask is empty.
    """
    return from_log_shading(
        grey_log_shading(log_image, mask),
        mask,
        lambda e, m, l: height_from_brightness(e, m, l, options),
    )


def height_from_brightness(
    brightness: np.ndarray,
    mask: np.ndarray,
    light: np.ndarray,
    options: TsaiShah1994Options | None = None,
) -> np.ndarray:
    """Compute the height from a grey shading image.

    Parameters
    ----------
    brightness : (H, W) ndarray
        Linear, max(0, n . light).
    mask : (H, W) bool ndarray
    light : (3,) ndarray
        Toward the light, camera frame.
    options : TsaiShah1994Options, optional

    Returns
    -------
    (H, W) float64 ndarray
        Pixels toward the viewer, mean 0 in the mask; outside, the height of the nearest rim pixel.

    Raises
    ------
    InputError
        If the mask is empty.
    """
    options = options or TsaiShah1994Options()
    box = Box.of(mask)
    shade, inside = box.crop(brightness), box.crop(mask)
    strength = max(float(np.linalg.norm(light)), 1e-30)
    x, y, z = _tilted(np.asarray(light, float) / strength, options.min_slant)
    # Flipped so that the light comes from the lower left; `_newton` uses left and lower neighbours.
    flips = tuple(axis for axis, flipped in ((0, y > 0), (1, x > 0)) if flipped)
    shade = np.clip(np.flip(shade, flips) / strength, 0, 1)
    height = np.flip(_newton(shade, np.flip(inside, flips), (-abs(x), -abs(y), z), options), flips)
    sigma = options.smoothing * float(np.sqrt(inside.sum()))
    smooth = _smooth_inside(height, inside, sigma) if sigma > 0 else height
    nearest = ndimage.distance_transform_edt(~inside, return_distances=False, return_indices=True)
    return box.place((smooth - smooth[inside].mean())[tuple(nearest)])


def _tilted(light: np.ndarray, min_slant: float) -> np.ndarray:
    slant = float(np.hypot(light[0], light[1]))
    if slant >= min_slant:
        return light
    direction = light[:2] / slant if slant > 1e-9 else np.sqrt([0.5, 0.5])
    return np.array([*(min_slant * direction), np.sqrt(1 - min_slant**2)])


def _newton(
    shade: np.ndarray,
    mask: np.ndarray,
    light: tuple[float, float, float],
    options: TsaiShah1994Options,
) -> np.ndarray:
    """Heights for a light with x, y <= 0, from differences to the left and lower neighbours in the
    mask.
    """
    x, y, z = light
    left, below = np.zeros_like(mask), np.zeros_like(mask)
    left[:, 1:] = mask[:, 1:] & mask[:, :-1]
    below[:-1] = mask[:-1] & mask[1:]
    height = np.zeros(mask.shape)
    for _ in range(max(1, round(options.steps * max(mask.shape)))):
        p = left * (height - np.roll(height, 1, axis=1))
        q = below * (height - np.roll(height, -1, axis=0))
        square = 1 + p * p + q * q
        root = np.sqrt(square)
        towards = (z - x * p - y * q) / root
        slope = -(x * left + y * below) / root - towards * (p + q) / square
        height += (
            mask * (shade - np.maximum(towards, 0)) * slope / (options.damping + slope * slope)
        )
    return height


def _smooth_inside(values: np.ndarray, mask: np.ndarray, sigma: float) -> np.ndarray:
    weight = ndimage.gaussian_filter(mask.astype(float), sigma, mode="constant")
    total = ndimage.gaussian_filter(values * mask, sigma, mode="constant")
    return np.where(mask, total / np.maximum(weight, 1e-12), 0)
