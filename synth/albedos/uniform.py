"""A uniform albedo: saturated, pale or dark."""

import numpy as np

from .colours import dark, pale, pigment


def texture(rng: np.random.Generator, size: int) -> np.ndarray:
    """Draw a uniform texture.

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
    make = rng.choice(3, p=(0.55, 0.3, 0.15))
    return np.broadcast_to((pigment, pale, dark)[make](rng), (size, size, 3)).copy()
