"""Averages that stay inside a mask: a Gaussian over the known pixels alone (normalised
convolution).

Equation: sum w G f / sum w G, with w = 1 inside the mask and 0 outside. Citation: H. Knutsson and
C.-F. Westin, "Normalized and differential convolution", CVPR 1993, doi:10.1109/CVPR.1993.341081.
"""

import numpy as np
from scipy import ndimage

_TINY = 1e-9


def masked_gaussian(layer: np.ndarray, mask: np.ndarray, sigma: float) -> np.ndarray:
    """`layer` (H, W) or (H, W, C), averaged by a Gaussian of standard deviation `sigma` pixels over
    `mask` (H, W) bool; 0 far outside.
    """
    if sigma <= 0:
        return layer
    return weighted_gaussian(layer, mask.astype(layer.dtype), sigma, _TINY)


def weighted_gaussian(
    layer: np.ndarray, weight: np.ndarray, sigma: float, floor: float
) -> np.ndarray:
    """`layer` (H, W) or (H, W, C) averaged with `weight` (H, W) >= 0;

    `floor` > 0 is the weight of a zero that is known everywhere.
    """
    below = ndimage.gaussian_filter(weight, sigma, truncate=3) + weight.dtype.type(floor)
    if layer.ndim == 2:
        return ndimage.gaussian_filter(weight * layer, sigma, truncate=3) / below
    return np.stack(
        [
            ndimage.gaussian_filter(weight * layer[..., c], sigma, truncate=3) / below
            for c in range(layer.shape[2])
        ],
        axis=2,
    )
