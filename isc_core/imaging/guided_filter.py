"""Local affine fits: how a quantity follows the colours of a picture around each pixel (the guided
filter, in colour).

Equation, over a window k inside the mask, for the picture I and the quantity e: e ~ A_k^T I + b_k,
A_k = (cov_k(I) + epsilon)^-1 (cov_k(I, e) + epsilon P_k),   b_k = mean_k e - A_k^T mean_k I. Where
the window's colours tell nothing A falls back to P, which is 0 in the published filter.

Citation: K. He, J. Sun, X. Tang, "Guided image filtering", TPAMI 35(6), 2013,
doi:10.1109/TPAMI.2012.213.
"""

import numpy as np
from scipy import ndimage

_RADIUS = 2  # of the window, in pixels


def affine_fit(
    guide: np.ndarray,
    values: np.ndarray,
    mask: np.ndarray,
    epsilon: float,
    fallback: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """A (H, W, 3, C) and b (H, W, C), averaged over the windows that hold a pixel; nothing useful
    outside `mask` (H, W).

    `guide` (H, W, 3), `values` (H, W, C), `epsilon` > 0 in the guide's square, `fallback`: P (H, W,
    3, C), None for 0.
    """
    mean_guide, mean_values = window_means(guide, mask), window_means(values, mask)
    own = (
        window_means(guide[..., :, None] * guide[..., None, :], mask)
        - mean_guide[..., :, None] * mean_guide[..., None, :]
    )
    common = (
        window_means(guide[..., :, None] * values[..., None, :], mask)
        - mean_guide[..., :, None] * mean_values[..., None, :]
    )
    slope = np.linalg.solve(
        own + epsilon * np.eye(3), common + (0 if fallback is None else epsilon * fallback)
    )
    offset = mean_values - np.einsum("hwgc,hwg->hwc", slope, mean_guide)
    return window_means(slope, mask), window_means(offset, mask)


def window_means(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Means (H, W, ...) over windows, of the mask's pixels alone; 0 where a window has none."""
    size = (2 * _RADIUS + 1,) * 2 + (1,) * (values.ndim - 2)
    inside = mask.reshape(mask.shape + (1,) * (values.ndim - 2)).astype(float)
    weight = ndimage.uniform_filter(inside, size, mode="constant")
    total = ndimage.uniform_filter(values * inside, size, mode="constant")
    return np.where(weight > 1e-9, total / np.maximum(weight, 1e-9), 0)
