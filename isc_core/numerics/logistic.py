"""Logistic regression with a ridge, by Newton's method.

Problem: find the weights w by which the log odds of a label are x . w.

Equation: w maximises the penalised log likelihood

    sum_n a_n (y_n log p_n + (1 - y_n) log(1 - p_n)) - 1/2 sum_k r_k w_k^2,
    p_n = 1 / (1 + exp(-x_n . w)),

which is concave. A Newton step that lowers it is halved: with outliers, full steps can diverge.

Citation: D. R. Cox 1958, doi:10.1111/j.2517-6161.1958.tb00292.x; the ridge: S. le Cessie, J. C. van
Houwelingen 1992, doi:10.2307/2347628.

Limits: without a ridge, the maximum is at infinity where a plane separates the labels.
"""

import numpy as np
from scipy.special import expit

from .linear import solve_linear

_STEPS = 100
_PRECISION = 1e-9  # of a step, of the weights: the error after it is of the order of its square
_ROUNDING = 1e-12  # of the loss


def logistic_weights(
    features: np.ndarray,
    labels: np.ndarray,
    ridge: float | np.ndarray = 0.0,
    weight: np.ndarray | None = None,
) -> np.ndarray:
    """Fit a logistic regression.

    Parameters
    ----------
    features : (N, K) ndarray
        x; for an offset, a column of ones.
    labels : (N,) ndarray
        y: bool, or probabilities in [0, 1].
    ridge : float or (K,) ndarray, optional
        r, >= 0.
    weight : (N,) ndarray, optional
        a, >= 0: how much each label counts; by default 1.

    Returns
    -------
    (K,) ndarray

    Raises
    ------
    ValueError
        If the weights do not converge: the labels are separable, or the columns linearly dependent,
        and there is no ridge.
    """
    counts = np.ones(len(features)) if weight is None else weight
    penalty = np.broadcast_to(ridge, features.shape[1])

    def loss(weights: np.ndarray) -> float:
        odds = np.einsum("nk,k->n", features, weights)
        return float(
            (counts * (np.logaddexp(0, odds) - labels * odds)).sum()
            + (penalty * weights**2).sum() / 2
        )

    weights = np.zeros(features.shape[1])
    before = loss(weights)
    for _ in range(_STEPS):
        share = expit(np.einsum("nk,k->n", features, weights))
        slope = np.einsum("nk,n->k", features, counts * (labels - share)) - penalty * weights
        scaled = features * (counts * share * (1 - share))[:, None]
        curvature = np.einsum("nk,nl->kl", scaled, features) + np.diag(penalty)
        try:
            step = solve_linear(curvature, slope[:, None])[:, 0]
        except ValueError:  # all probabilities are 0 or 1, or a column is redundant
            break
        while (after := loss(weights + step)) > before + _ROUNDING * abs(before):
            step = step / 2
        weights, before = weights + step, after
        if np.abs(step).max() <= _PRECISION * max(np.abs(weights).max(), 1.0):
            return weights
    raise ValueError("the weights do not converge: a ridge above 0 is missing")
