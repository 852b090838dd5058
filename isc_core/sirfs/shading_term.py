"""Predicted log shading as a soft term of the SIRFS objective.

Problem: a network sees in the whole photo what is shading and what is print, which the priors of
neighbouring pixels cannot.

Equation: with the log shading S_c of the current normals and light, the predicted mean m_c and the
deviation s of each of n valid pixels and C channels,
  cost = w/(n C) * sum over pixels and channels of (S_c - m_c - k_c)^2 / (2 s^2).
Brightness cannot be told from albedo, so k is free: one constant for photos of balanced colours,
one for each channel where the light may have any colour. At its optimum, the mean of S - m weighted
by 1 / s^2, the derivative by k is 0, so
  d cost / d S_c = w/(n C) * (S_c - m_c - k_c) / s^2.

Citation: none; the quadratic term of a Gaussian likelihood with unknown constants profiled out.

Limits: s is the deviation of one pixel, while errors of neighbours and of channels are correlated;
w, well below the 1 of independent errors, compensates for that on average.
"""

from dataclasses import dataclass

import numpy as np

from ..scene.shading_estimate import ShadingEstimate
from .precision import strength_of

_LEAST_DEVIATION = 0.03  # of log shading: nobody knows it better, and 1 / s^2 stays bounded


@dataclass(frozen=True)
class ExpectedShading:
    """Expected log shading.

    Attributes
    ----------
    mean : (H, W, C) ndarray
        Log shading up to k.
    precision : (H, W) ndarray
        1 / s^2 of each channel; 0 where nothing is expected.
    """

    mean: np.ndarray
    precision: np.ndarray


def expected_shading(estimate: ShadingEstimate | None, channels: int) -> ExpectedShading | None:
    """Return what a prediction lets the solver expect.

    Parameters
    ----------
    estimate : ShadingEstimate or None
        Prediction of shape (H, W).
    channels : int
        3, or 1 for the mean of the channels.

    Returns
    -------
    ExpectedShading or None
        None without a prediction.
    """
    if estimate is None:
        return None
    known = estimate.deviation > 0
    deviation = np.maximum(np.where(known, estimate.deviation, 1.0), _LEAST_DEVIATION)
    mean = np.where(known[..., None], estimate.log_shading, 0.0)
    return ExpectedShading(
        mean if channels == 3 else mean.mean(axis=2, keepdims=True),
        np.where(known, 1 / np.square(deviation, dtype=float), 0.0),
    )


def shading_cost(
    log_shading: np.ndarray,
    expected: ExpectedShading,
    valid: np.ndarray,
    weight: float,
    *,
    balanced: bool,
) -> tuple[float, np.ndarray]:
    """Compute the term of the expected shading.

    Parameters
    ----------
    log_shading : (H, W, C) ndarray
        Of the current normals and light.
    expected : ExpectedShading
    valid : (H, W) bool ndarray
    weight : float
    balanced : bool
        Whether k is one constant for all channels.

    Returns
    -------
    cost : float
    gradient : (H, W, C) ndarray
        With respect to the log shading.
    """
    t = log_shading.dtype
    strength = strength_of(expected.precision, valid, weight, log_shading.shape[2])
    away = log_shading - expected.mean.astype(t)
    sums = (strength[..., None] * away).sum(axis=(0, 1), dtype=float)
    away = away - best_offsets(sums, float(strength.sum(dtype=float)), balanced).astype(t)
    pull = strength.astype(t)[..., None] * away
    return 0.5 * float((pull * away).sum(dtype=float)), pull


def best_offsets(sums: np.ndarray, total: float, balanced: bool) -> np.ndarray:
    """Return the constants k at which the term is least.

    Parameters
    ----------
    sums : (C,) ndarray
        Sums over pixels of strength times S - m.
    total : float
        Sum of the strengths.
    balanced : bool
        Whether k is one constant for all channels.

    Returns
    -------
    (C,) ndarray
        0 if nothing is expected anywhere.
    """
    if total <= 0:
        return np.zeros(len(sums))
    return (np.full(len(sums), sums.mean()) if balanced else sums) / total
