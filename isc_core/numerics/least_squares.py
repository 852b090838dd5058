"""Robust nonlinear least squares of a few parameters with bounds.

Equation: minimise sum_i 2 (sqrt(1 + r_i^2 / s^2) - 1), r the residuals: quadratic for small ones,
linear beyond s. With the weights w_i = 1 / sqrt(1 + r_i^2 / s^2) and the Jacobian J, a step d
solves (J^T W J + m D) d = -J^T W r, D the diagonal of J^T W J, for the parameters that no bound
stops; the result is moved to the nearest point within the bounds. The damping m falls after a step
that lowers the loss, and rises after any other, which is not taken.

Citation: D. W. Marquardt, SIAM J. Appl. Math. 11(2) (1963), doi:10.1137/0111030; P. Charbonnier, L.
Blanc-Feraud, G. Aubert, M. Barlaud, IEEE TIP 6(2) (1997), doi:10.1109/83.551699; bounds: C. Kanzow,
N. Yamashita, M. Fukushima, J. Comput. Appl. Math. 172(2) (2004), doi:10.1016/j.cam.2004.02.013.

SciPy's `least_squares` minimises the same loss, but its import takes as long as a photo's shape and
light.

Limits: a local search. The Jacobian is that of finite differences.
"""

from collections.abc import Callable

import numpy as np

from .linear import solve_linear

_DIFFERENCE = 1.5e-8  # of a parameter, or of 1: the square root of the precision
_ENOUGH = 1e-9  # of the loss: a smaller decrease is the last
_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-9, 1e9


def robust_least_squares(
    residuals: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    scale: float,
    steps: int = 100,
) -> np.ndarray:
    """Minimise the robust loss of residuals.

    Parameters
    ----------
    residuals : callable
        Returns the residuals (N,) of parameters (P,).
    start : (P,) ndarray
        Moved to the nearest point within the bounds.
    bounds : tuple of (P,) ndarray
        Lower and upper ones; may be infinite.
    scale : float
        s, in the unit of the residuals; above 0.
    steps : int
        Largest number of Jacobians.

    Returns
    -------
    (P,) ndarray
        The parameters with the smallest loss found, which is no larger than that of the start.
    """
    low, high = bounds
    x = np.clip(start, low, high)
    error, damping = residuals(x), _DAMPING
    loss = robust_loss(error, scale)
    for _ in range(steps):
        jacobian = _jacobian(residuals, x, error, high)
        weighted = jacobian / np.sqrt(1 + np.square(error / scale))[:, None]
        # not `@`, whose sums depend on the number of threads
        gradient = np.einsum("np,n->p", weighted, error)
        curvature = np.einsum("np,nq->pq", weighted, jacobian)
        free = ~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))
        before = loss
        while damping < _MOST_DAMPING and free.any():
            trial = x.copy()
            trial[free] -= _step(curvature[np.ix_(free, free)], gradient[free], damping)
            trial = np.clip(trial, low, high)
            found = residuals(trial)
            if (lower := robust_loss(found, scale)) < loss:
                x, error, loss = trial, found, lower
                damping = max(damping / 10, _LEAST_DAMPING)
                break
            damping *= 10
        if before - loss <= _ENOUGH * before:
            break
    return x


def robust_loss(error: np.ndarray, scale: float) -> float:
    """Return half of the loss of residuals.

    Parameters
    ----------
    error : (...) ndarray
    scale : float
        s; above 0.

    Returns
    -------
    float
    """
    square = np.square(error / scale)
    return float(np.sum(square / (1 + np.sqrt(1 + square))))


def _jacobian(
    residuals: Callable[[np.ndarray], np.ndarray],
    x: np.ndarray,
    error: np.ndarray,
    high: np.ndarray,
) -> np.ndarray:
    """The derivatives (N, P), by differences within the bounds."""
    columns = []
    for k, size in enumerate(_DIFFERENCE * np.maximum(np.abs(x), 1)):
        near = x.copy()
        near[k] += size if x[k] + size <= high[k] else -size
        columns.append((residuals(near) - error) / (near[k] - x[k]))
    return np.stack(columns, 1)


def _step(curvature: np.ndarray, gradient: np.ndarray, damping: float) -> np.ndarray:
    diagonal = np.diag(curvature)
    # without effect on the residuals, a parameter stays
    ridge = damping * diagonal + np.where(diagonal > 0, 0, max(float(diagonal.max()), 1e-300))
    return solve_linear(curvature + np.diag(ridge), gradient[:, None])[:, 0]
