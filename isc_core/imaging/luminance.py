"""Luminance of linear Rec.709 light, and the white level of an image layer.

Citation: ITU-R BT.709-6 (2015).
"""

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear Rec.709


def luminance(color: np.ndarray) -> np.ndarray:
    """Return the luminance of linear Rec.709 colours.

    Parameters
    ----------
    color : (..., 3) ndarray

    Returns
    -------
    (...) float64 ndarray
    """
    return np.asarray(color, float) @ LUMINANCE


def white_of(layer: np.ndarray, mask: np.ndarray, percentile: float = 99.5) -> float:
    """Return the white level of a layer: a percentile of the largest channel over the lit pixels.

    Parameters
    ----------
    layer : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    percentile : float
        In [0, 100].

    Returns
    -------
    float
        1 if no pixel is lit.
    """
    bright = layer[mask].max(-1)
    lit = bright[bright > 0]
    return float(np.percentile(lit, percentile)) if lit.size else 1.0
