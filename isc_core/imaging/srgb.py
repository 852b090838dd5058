"""The transfer curve of sRGB.

It uses NumPy alone, so that Blender's own process can use it too.

Equation: coded = 12.92 L for L <= 0.0031308, else 1.055 L^(1/2.4) - 0.055.

Citation: IEC 61966-2-1:1999, Multimedia systems and equipment - Colour measurement and management -
Part 2-1: sRGB (no DOI).

Limits: nominally [0, 1]; other values follow the two branches of the curve.
"""

import numpy as np


def srgb_to_linear(coded: np.ndarray | float) -> np.ndarray:
    """Decode sRGB values to linear light.

    Parameters
    ----------
    coded : ndarray or float
        Nominally in [0, 1]; other values follow the two branches of the curve.

    Returns
    -------
    ndarray
    """
    x = np.asarray(coded)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: np.ndarray | float) -> np.ndarray:
    """Encode linear light as sRGB; the inverse of `srgb_to_linear`.

    Parameters
    ----------
    linear : ndarray or float
        Nominally in [0, 1].

    Returns
    -------
    ndarray
    """
    x = np.asarray(linear)
    return np.where(
        x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1.0 / 2.4) - 0.055
    )
