"""Precisions of expected values as factors of a term's half squares."""

import numpy as np


def strength_of(
    precision: np.ndarray, valid: np.ndarray, weight: float, channels: int = 1
) -> np.ndarray:
    """Return the factor of each pixel's half squares in a mean over valid pixels and channels.

    Parameters
    ----------
    precision : (H, W) ndarray
        1 / s^2; 0 where nothing is expected.
    valid : (H, W) bool ndarray
    weight : float
        Weight of the term.
    channels : int

    Returns
    -------
    (H, W) float64 ndarray
    """
    return np.where(valid, precision, 0) * (weight / (max(int(valid.sum()), 1) * channels))
