"""Gaussian smoothing over the pixels of a mask (normalised convolution).

Equation: sum w G f / sum w G, with w = 1 inside the mask and 0 outside.

Citation: H. Knutsson and C.-F. Westin, "Normalized and differential convolution", CVPR 1993,
doi:10.1109/CVPR.1993.341081.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from ..filters.gaussian import gaussian_average

_TINY = 1e-9


def masked_gaussian(layer: np.ndarray, mask: np.ndarray, sigma: float) -> np.ndarray:
    """Smooth a layer by a Gaussian over the pixels of a mask.

    Parameters
    ----------
    layer : (H, W) or (H, W, C) ndarray
    mask : (H, W) bool ndarray
    sigma : float
        Standard deviation in pixels; the layer is returned unchanged if it is not positive.

    Returns
    -------
    ndarray
        Of the layer's shape; 0 far outside the mask.
    """
    if sigma <= 0:
        return layer
    return weighted_gaussian(layer, mask.astype(layer.dtype), sigma, _TINY)


def masked_low_pass(layer: np.ndarray, mask: np.ndarray, sigma: float) -> np.ndarray:
    """Return the low frequencies of a layer, `low_pass` by `masked_gaussian`.

    Parameters
    ----------
    layer : (H, W) or (H, W, C) ndarray
    mask : (H, W) bool ndarray
    sigma : float
        Standard deviation of G in pixels: a period of 3.535 sigma is halved.

    Returns
    -------
    ndarray
        Of the layer's shape.
    """
    return low_pass(layer, partial(masked_gaussian, mask=mask, sigma=sigma))


def low_pass(layer: np.ndarray, average: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the low frequencies of a layer, 1 - (1 - G)^3 of it.

    Parameters
    ----------
    layer : ndarray
    average : callable
        G, from a layer to its local averages.

    Returns
    -------
    ndarray
        Of the layer's shape.
    """
    rest = layer
    for _ in range(3):
        rest = rest - average(rest)
    return np.asarray(layer - rest)


def weighted_gaussian(
    layer: np.ndarray, weight: np.ndarray, sigma: float, floor: float
) -> np.ndarray:
    """Smooth a layer by a Gaussian with a weight for each pixel.

    Parameters
    ----------
    layer : (H, W) or (H, W, C) ndarray
    weight : (H, W) ndarray
        Not negative.
    sigma : float
        Standard deviation in pixels.
    floor : float
        Weight, greater than 0, of the value 0 that is added at every pixel.

    Returns
    -------
    ndarray
        Of the layer's shape.
    """
    below = gaussian_average(weight, sigma, cut=3) + weight.dtype.type(floor)
    if layer.ndim == 2:
        return gaussian_average(weight * layer, sigma, cut=3) / below
    return np.stack(
        [
            gaussian_average(weight * layer[..., c], sigma, cut=3) / below
            for c in range(layer.shape[2])
        ],
        axis=2,
    )
