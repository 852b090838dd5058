"""Uncertainty of a least-squares fit whose errors are not independent.

Equation: with the scores g_i = w_i r_i J_i summed over blocks B of neighbouring pixels, and H = sum
w_i J_i J_i^T,

    covariance = H^-1 (sum_B g_B g_B^T) H^-1 b / (b - p / 2),  b effective blocks, p parameters.

Errors within a block may be correlated in any way; a block is about as wide as a highlight, since
errors of the normals, the separation or the lobe's shape affect all of it.

Citation: K.-Y. Liang and S. L. Zeger, "Longitudinal data analysis using generalized linear models",
Biometrika 73(1) (1986), 13-22, doi:10.1093/biomet/73.1.13 (the sandwich over clusters).

Limits: an error that is the same everywhere does not affect the residuals; `normal_error` accounts
for it.
"""

import numpy as np

from .lamps import weighted_product
from .pixels import Pixels

_MIN_BLOCKS = 4.0  # blocks: a highlight is divided into at least four


def covariance(
    jacobian: np.ndarray, residual: np.ndarray, weight: np.ndarray, pixels: Pixels
) -> np.ndarray:
    """Estimate the covariance of the parameters.

    Parameters
    ----------
    jacobian : (N, P) ndarray
        Of the residual, in sigmas.
    residual : (N,) ndarray
        In sigmas.
    weight : (N,) ndarray
        Of each pixel.
    pixels : Pixels
        The fitted pixels.

    Returns
    -------
    (P, P) ndarray
        The covariance.
    """
    bread = _inverse(weighted_product(jacobian, weight, jacobian))
    side = max(3.0, float(np.sqrt(pixels.bright / np.pi)))
    cell = np.floor(pixels.cell / side).astype(int)
    _, block = np.unique(cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1], return_inverse=True)
    scores = jacobian * (weight * residual)[:, None]
    sums = np.stack([np.bincount(block, column) for column in scores.T], axis=1)
    leverage = np.bincount(block, weight * (jacobian @ bread * jacobian).sum(axis=1))
    count = float(leverage.sum() ** 2 / max((leverage**2).sum(), 1e-300))
    free = max(count - jacobian.shape[1] / 2, 1.0)
    return bread @ (sums.T @ sums) @ bread * max(count, _MIN_BLOCKS) / free


def naive_variance(jacobian: np.ndarray, weight: np.ndarray, column: int) -> float:
    """Return one parameter's variance, as if all errors were independent.

    Parameters
    ----------
    jacobian : (N, P) ndarray
        Of the residual, in sigmas.
    weight : (N,) ndarray
        Weights of the residuals.
    column : int
        The parameter's column of `jacobian`.

    Returns
    -------
    float
    """
    return float(_inverse(weighted_product(jacobian, weight, jacobian))[column, column])


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric, possibly singular matrix: columns without effect get variance 0."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0))
    scale = np.where(scale > 1e-12 * max(float(scale.max()), 1e-300), scale, np.inf)
    return np.asarray(
        np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-12, hermitian=True)
    ) / np.outer(scale, scale)
