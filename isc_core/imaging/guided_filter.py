"""Local affine models of a quantity in the colours of an image (the guided filter, in colour).

Equation, over a window k inside the mask, for the image I and the quantity e: e ~ A_k^T I + b_k,

    A_k = (cov_k(I) + epsilon)^-1 (cov_k(I, e) + epsilon P_k),   b_k = mean_k e - A_k^T mean_k I.

Where the colours of the window are uninformative, A falls back to P, which is 0 in the published
filter.

Citation: K. He, J. Sun, X. Tang, "Guided image filtering", TPAMI 35(6), 2013,
doi:10.1109/TPAMI.2012.213.
"""

import numpy as np

from ..filters.box import box_average

_RADIUS = 2  # of the window, in pixels


def affine_fit(
    guide: np.ndarray,
    values: np.ndarray,
    mask: np.ndarray,
    epsilon: float,
    fallback: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Fit local affine models, averaged over the windows that contain a pixel.

    Parameters
    ----------
    guide : (H, W, 3) ndarray
    values : (H, W, C) ndarray
    mask : (H, W) bool ndarray
        Results outside it are undefined.
    epsilon : float
        Regularisation, greater than 0, in units of the guide squared.
    fallback : (H, W, 3, C) ndarray, optional
        The slope P; 0 by default.

    Returns
    -------
    slope : (H, W, 3, C) ndarray
    offset : (H, W, C) ndarray
    """
    mean_guide, mean_values = window_means(guide, mask), window_means(values, mask)
    covariance = (
        window_means(guide[..., :, None] * guide[..., None, :], mask)
        - mean_guide[..., :, None] * mean_guide[..., None, :]
    )
    cross_covariance = (
        window_means(guide[..., :, None] * values[..., None, :], mask)
        - mean_guide[..., :, None] * mean_values[..., None, :]
    )
    slope = np.linalg.solve(
        covariance + epsilon * np.eye(3),
        cross_covariance + (0 if fallback is None else epsilon * fallback),
    )
    offset = mean_values - np.einsum("hwgc,hwg->hwc", slope, mean_guide)
    return window_means(slope, mask), window_means(offset, mask)


def window_means(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return means over windows, of the pixels inside a mask.

    Parameters
    ----------
    values : (H, W, ...) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W, ...) ndarray
        0 where a window has no pixel of the mask.
    """
    size = 2 * _RADIUS + 1
    inside = mask.reshape(mask.shape + (1,) * (values.ndim - 2)).astype(float)
    weight = box_average(inside, size)
    total = box_average(values * inside, size)
    return np.where(weight > 1e-9, total / np.maximum(weight, 1e-9), 0)
