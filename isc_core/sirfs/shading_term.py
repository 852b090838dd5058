"""Predicted log shading as a soft term of the SIRFS objective.

Problem: from the whole photo, a network can distinguish shading from printed patterns; priors on
neighbouring pixels cannot.

Equation: with the log shading S_c of the current normals and light, the predicted mean m_c and the
deviation s of each of n valid pixels and C channels,
  cost = w/(n C) * sum over pixels and channels of (S_c - m_c - k_c)^2 / (2 s^2).
Brightness and albedo are ambiguous, so k is free: one constant for photos, whose predicted shading
then also tells the light's colour, and one for each channel in the illuminations of the data set.
Photos have one constant under `--light-colour free`, too: the light may then have any colour, and
the prediction is what recovers it. At its optimum, the mean of S - m weighted by 1 / s^2, the
derivative with respect to k is 0, so
  d cost / d S_c = w/(n C) * (S_c - m_c - k_c) / s^2.

Citation: none; the quadratic term of a Gaussian likelihood with unknown constants profiled out.

Limits: s is the deviation of one pixel, while errors of neighbours and of channels are correlated;
w, well below the 1 of independent errors, compensates for that on average.
"""

from dataclasses import dataclass

import numpy as np

from ..scene.shading_estimate import ShadingEstimate
from .precision import scaled_precision

_MIN_DEVIATION = 0.03  # of log shading: predictions are not more accurate; bounds 1 / s^2


@dataclass(frozen=True, eq=False)
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
    """Convert a prediction to an expectation of the solver.

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
    deviation = np.maximum(np.where(known, estimate.deviation, 1.0), _MIN_DEVIATION)
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
    precision = scaled_precision(expected.precision, valid, weight, log_shading.shape[2])
    residual = log_shading - expected.mean.astype(t)
    sums = (precision[..., None] * residual).sum(axis=(0, 1), dtype=float)
    residual = residual - optimal_offsets(sums, float(precision.sum(dtype=float)), balanced).astype(
        t
    )
    gradient = precision.astype(t)[..., None] * residual
    return 0.5 * float((gradient * residual).sum(dtype=float)), gradient


def optimal_offsets(sums: np.ndarray, total: float, balanced: bool) -> np.ndarray:
    """Return the constants k that minimise the term.

    Parameters
    ----------
    sums : (C,) ndarray
        Sums over pixels of the scaled precision times S - m.
    total : float
        Sum of the scaled precisions.
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
