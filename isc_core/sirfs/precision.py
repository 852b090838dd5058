"""Precisions of expected values, scaled by the weight of their term."""

import numpy as np


def scaled_precision(
    precision: np.ndarray, valid: np.ndarray, weight: float, channels: int = 1
) -> np.ndarray:
    """Scale precisions by a term's weight over the number of valid pixels and channels.

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
