"""Albedos without colour, R = G = B to the last bit: one grey, or the luminance of one of the
coloured families.
"""

import numpy as np

from . import noise, patches, prints

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec.709


def texture(rng: np.random.Generator, size: int) -> np.ndarray:
    """Draw an achromatic texture.

    Parameters
    ----------
    rng : numpy.random.Generator
        Random numbers.
    size : int
        Side in texels.

    Returns
    -------
    (size, size, 3) ndarray
        Linear Rec.709.
    """
    if rng.random() < 0.25:
        return np.full((size, size, 3), np.exp(rng.uniform(np.log(0.04), np.log(0.85))))
    coloured = (patches, prints, noise)[rng.integers(3)].texture(rng, size)
    return np.repeat((coloured @ _LUMINANCE)[..., None], 3, axis=2)
