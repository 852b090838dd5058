"""Least-squares fit of a light to log shading and normals.

Equation: L minimises the mean over the mask of |b(n) L - log shading|^2 + ridge * |L without its
constant|^2, for each channel; b are the nine functions of the SIRFS reference. The ridge excludes
the constant, so a flat shape, whose normals do not determine a direction, has a uniform light.

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.
"""

import numpy as np

from ..errors import InputError
from ..shading.irradiance_basis import basis


def fit_light(
    log_shading: np.ndarray, normals: np.ndarray, mask: np.ndarray, ridge: float = 1e-3
) -> np.ndarray:
    """Fit a light.

    Parameters
    ----------
    log_shading : (H, W, C) ndarray
        Natural logarithm.
    normals : (H, W, 3) ndarray
        Unit vectors (down, right, toward the viewer).
    mask : (H, W) bool ndarray
    ridge : float
        > 0.

    Returns
    -------
    (9, C) float64 ndarray
        Reference convention.

    Raises
    ------
    InputError
        If the mask is empty.
    """
    if not mask.any():
        raise InputError("the mask is empty: mark at least the object's pixels")
    functions = basis(*normals[mask].astype(float).T)
    count = functions.shape[1]
    penalty = ridge * np.eye(9)
    penalty[0, 0] = 1e-12
    # Without BLAS, whose rounding depends on the number of threads.
    gram = np.einsum("kn,ln->kl", functions, functions) / count
    return np.linalg.solve(
        gram + penalty, np.einsum("kn,nc->kc", functions, log_shading[mask].astype(float)) / count
    )
