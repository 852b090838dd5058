"""Lightness, chroma and hue in the perceptually uniform space Oklab.

Equation: with the cube roots (l, m, s)' of three mixtures of linear Rec.709, (L, a, b) = M (l, m,
s)'; hue is the angle of (a, b), chroma its length. Both matrices are the published constants.

Citation: B. Ottosson, "A perceptual color space for image processing" (2020), public domain, no
DOI.
"""

import numpy as np

_MIX = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def to_oklab(linear: np.ndarray) -> np.ndarray:
    """Convert linear Rec.709 to Oklab.

    Parameters
    ----------
    linear : (..., 3) ndarray
        Linear Rec.709.

    Returns
    -------
    (..., 3) ndarray
        L, a, b.
    """
    return np.cbrt(np.asarray(linear, float) @ _MIX.T) @ _LAB.T


def from_oklab(lab: np.ndarray) -> np.ndarray:
    """Convert Oklab to linear Rec.709.

    Parameters
    ----------
    lab : (..., 3) ndarray
        L, a, b.

    Returns
    -------
    (..., 3) ndarray
        Some channels are negative outside the gamut.
    """
    return (np.asarray(lab, float) @ np.linalg.inv(_LAB).T) ** 3 @ np.linalg.inv(_MIX).T
