"""Predicted log shading as a soft term of the SIRFS objective.

Problem: a network sees in the whole photo what is shading and what is print, which the priors of
neighbouring pixels cannot.

Equation: with the log shading S_c of the current normals and light, the predicted mean m_c and the
deviation s of each of n valid pixels and C channels,
  cost = w/(n C) * sum over pixels and channels of (S_c - m_c - k)^2 / (2 s^2).
Brightness cannot be told from albedo, so k is free. At its optimum, the mean of S - m weighted by
1 / s^2, the derivative by k is 0, so
  d cost / d S_c = w/(n C) * (S_c - m_c - k) / s^2.

Citation: none; the quadratic term of a Gaussian likelihood with one unknown profiled out.

Limits: s is the deviation of one pixel, while errors of neighbours and of channels are correlated;
w, well below the 1 of independent errors, compensates for that on average. The cost is quadratic: a
saturating one would leave no closed form for k, and where a prediction fails, its s should say so.
"""

from dataclasses import dataclass

import numpy as np

from ..scene.shading_estimate import ShadingEstimate

_LEAST_DEVIATION = 0.03  # of log shading: nobody knows it better, and 1 / s^2 stays bounded


@dataclass(frozen=True)
class ExpectedShading:
    """Expected log shading.

    Attributes
    ----------
    mean : (H, W, C) ndarray
        Log shading up to one constant.
    precision : (H, W) ndarray
        1 / s^2 of each channel; 0 where nothing is expected.
    """

    mean: np.ndarray
    precision: np.ndarray

    def strength(self, valid: np.ndarray, weight: float) -> np.ndarray:
        """Return the factor of each pixel's half squares.

        Parameters
        ----------
        valid : (H, W) bool ndarray
        weight : float
            Weight of the term.

        Returns
        -------
        (H, W) float64 ndarray
        """
        scale = weight / (max(int(valid.sum()), 1) * self.mean.shape[2])
        return np.where(valid, self.precision, 0) * scale


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
    log_shading: np.ndarray, expected: ExpectedShading, valid: np.ndarray, weight: float
) -> tuple[float, np.ndarray]:
    """Compute the term of the expected shading.

    Parameters
    ----------
    log_shading : (H, W, C) ndarray
        Of the current normals and light.
    expected : ExpectedShading
    valid : (H, W) bool ndarray
    weight : float

    Returns
    -------
    cost : float
    gradient : (H, W, C) ndarray
        With respect to the log shading.
    """
    t = log_shading.dtype
    strength = expected.strength(valid, weight)
    away = log_shading - expected.mean.astype(t)
    offset = best_offset(
        float((strength[..., None] * away).sum(dtype=float)), strength, away.shape[2]
    )
    away = away - t.type(offset)
    pull = strength.astype(t)[..., None] * away
    return 0.5 * float((pull * away).sum(dtype=float)), pull


def best_offset(weighted: float, strength: np.ndarray, channels: int) -> float:
    """Return the constant k at which the term is least.

    Parameters
    ----------
    weighted : float
        Sum over pixels and channels of strength times S - m.
    strength : (H, W) ndarray
        See `ExpectedShading.strength`.
    channels : int

    Returns
    -------
    float
        0 if nothing is expected anywhere.
    """
    total = channels * float(strength.sum(dtype=float))
    return weighted / total if total > 0 else 0.0
