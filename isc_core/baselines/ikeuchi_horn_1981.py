"""Shape from shading by minimising brightness error and roughness of the normals (Ikeuchi & Horn
1981).

Problem: find stereographic coordinates (u, v) = 2 (n_x, n_y) / (1 + n_z) of the normals that
minimise
  sum of (E - R(u, v))^2 + weight * (|grad u|^2 + |grad v|^2),   R = max(0, n . l),
with n in the image plane, along the contour's normal, at the occluding contour: there (u, v) has
length 2, while slopes would be infinite.

Equation: setting the derivative to zero gives the iteration (u, v) <- mean of neighbours + (E - R)
grad R / weight, from coarse to fine, because the contour's influence propagates by one pixel per
iteration. The normals are integrated by least squares.

Citation: K. Ikeuchi and B. K. P. Horn, "Numerical shape from shading and occluding boundaries",
Artificial Intelligence 17(1-3), 141-184 (1981), doi:10.1016/0004-3702(81)90023-0. The integration
is as in R. T. Frankot and R. Chellappa, IEEE TPAMI 10(4), 439-451 (1988), doi:10.1109/34.3909, but
in the mask.

Limits: one distant light, one albedo; every contour is assumed to be occluding, so flat objects
bulge; smoothness flattens detail.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..shading.occluding_contour import occluding_contour
from .box import Box
from .from_shading import BaselineEstimate, from_log_shading, grey_log_shading
from .poisson import integrate

_NEIGHBOURS = np.array([[1.0, 4.0, 1.0], [4.0, 0.0, 4.0], [1.0, 4.0, 1.0]]) / 20
_MIN_SIDE = 24


@dataclass(frozen=True)
class IkeuchiHorn1981Options:
    """Options of the estimate of the normals.

    Attributes
    ----------
    weight : float
        Weight of the smoothness, > 0, for brightness scaled to a light of length 1.
    iterations : int
        On each grid.
    steepest : float
        Smallest n_z, in (0, 1), for slopes; at the contour, they would be infinite.
    """

    weight: float = 1.0
    iterations: int = 100
    steepest: float = 0.2


def estimate(
    log_image: np.ndarray, mask: np.ndarray, options: IkeuchiHorn1981Options | None = None
) -> BaselineEstimate:
    """Estimate shape and light of an object of one albedo: all its brightness is shading.

    Parameters
    ----------
    log_image : (H, W, 3) ndarray
        Natural logarithm of a linear image, finite in the mask.
    mask : (H, W) bool ndarray
    options : IkeuchiHorn1981Options, optional

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
    options: IkeuchiHorn1981Options | None = None,
) -> np.ndarray:
    """Compute the height from a grey shading image.

    Parameters
    ----------
    brightness : (H, W) ndarray
        Linear, max(0, n . light).
    mask : (H, W) bool ndarray
    light : (3,) ndarray
        Toward the light, camera frame.
    options : IkeuchiHorn1981Options, optional

    Returns
    -------
    (H, W) float64 ndarray
        Pixels toward the viewer, mean 0 in the mask, extrapolated by two pixels beyond its rim.

    Raises
    ------
    InputError
        If the mask is empty.
    """
    options = options or IkeuchiHorn1981Options()
    box = Box.of(mask)
    inside = box.crop(mask)
    strength = max(float(np.linalg.norm(light)), 1e-30)
    shade = np.where(inside, np.clip(box.crop(brightness) / strength, 0, 1), 0).astype(float)
    uv = _solve(shade, inside, np.asarray(light, float) / strength, options)
    return box.place(height_from_normals(_normals(uv), inside, options.steepest))


def height_from_normals(normals: np.ndarray, mask: np.ndarray, steepest: float) -> np.ndarray:
    """Integrate normals by least squares.

    The slopes at the rim are extrapolated by two pixels beyond the mask, so that differences across
    the rim are meaningful; farther out, the height is constant.

    Parameters
    ----------
    normals : (H, W, 3) ndarray
        Camera frame.
    mask : (H, W) bool ndarray
    steepest : float
        See `IkeuchiHorn1981Options`.

    Returns
    -------
    (H, W) ndarray
    """
    wide = ndimage.binary_dilation(mask, np.ones((3, 3)), iterations=2)
    nearest = ndimage.distance_transform_edt(~mask, return_distances=False, return_indices=True)
    n = normals[tuple(nearest)]
    toward = np.maximum(n[..., 2], steepest)
    p, q = -n[..., 0] / toward, -n[..., 1] / toward
    right, down = np.zeros(mask.shape), np.zeros(mask.shape)
    right[:, :-1] = (p[:, :-1] + p[:, 1:]) / 2
    down[:-1] = -(q[:-1] + q[1:]) / 2
    height = integrate(right, down, wide)
    outward = ndimage.distance_transform_edt(~wide, return_distances=False, return_indices=True)
    return height[tuple(outward)] - height[mask].mean()


def _solve(
    shade: np.ndarray, mask: np.ndarray, light: np.ndarray, options: IkeuchiHorn1981Options
) -> np.ndarray:
    """Coordinates (2, H, W), 0 outside the mask, initialised from the solution at half the size."""
    if min(mask.shape) >= 2 * _MIN_SIDE:
        smaller = _solve(_halved(shade, mask), _block_any(mask), light, options)
        start = (
            smaller.repeat(2, axis=1).repeat(2, axis=2)[:, : mask.shape[0], : mask.shape[1]] * mask
        )
    else:
        start = np.zeros((2, *mask.shape))
    return _relax(start, shade, mask, light, options)


def _relax(
    uv: np.ndarray,
    shade: np.ndarray,
    mask: np.ndarray,
    light: np.ndarray,
    options: IkeuchiHorn1981Options,
) -> np.ndarray:
    contour = occluding_contour(mask)
    at = (contour.rows, contour.columns)
    rim = 2 * np.stack([contour.right, -contour.down])
    known = ndimage.correlate(mask.astype(float), _NEIGHBOURS, mode="constant")
    scale = mask / np.maximum(known, 1e-12)
    for _ in range(options.iterations):
        uv[:, *at] = rim
        mean = np.stack([ndimage.correlate(c, _NEIGHBOURS, mode="constant") for c in uv]) * scale
        reflected, slope = _reflect(mean, light)
        # Linearised about the neighbours' mean, the step is the exact minimum for each pixel and
        # cannot overshoot.
        uv = mean + mask * (shade - reflected) / (options.weight + (slope**2).sum(axis=0)) * slope
        # Outside the circle of radius 2, normals would point away from the viewer.
        uv *= np.minimum(1, 2 / np.maximum(np.hypot(*uv), 1e-12))
    uv[:, *at] = rim
    return uv


def _normals(uv: np.ndarray) -> np.ndarray:
    """Unit normals (H, W, 3)."""
    u, v = uv
    square = u * u + v * v
    return np.stack([4 * u, 4 * v, 4 - square], axis=-1) / (4 + square)[..., None]


def _reflect(uv: np.ndarray, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """max(0, n . l), (H, W), and its derivatives, (2, H, W)."""
    below = 4 + uv[0] ** 2 + uv[1] ** 2
    towards = (4 * (light[0] * uv[0] + light[1] * uv[1]) + light[2] * (8 - below)) / below
    slope = np.stack([(4 * light[k] - 2 * uv[k] * (light[2] + towards)) / below for k in (0, 1)])
    return np.maximum(towards, 0), np.where(towards > 0, slope, 0)


def _blocks(values: np.ndarray) -> np.ndarray:
    padded = np.pad(values, [(0, n % 2) for n in values.shape])
    return padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2)


def _block_any(mask: np.ndarray) -> np.ndarray:
    return np.asarray(_blocks(mask).any(axis=(1, 3)))


def _halved(shade: np.ndarray, mask: np.ndarray) -> np.ndarray:
    count = _blocks(mask.astype(float)).sum(axis=(1, 3))
    return np.asarray(_blocks(shade * mask).sum(axis=(1, 3)) / np.maximum(count, 1))
