"""A uniform albedo: saturated, pale or dark."""

import numpy as np

from .colours import dark, pale, pigment


def texture(rng: np.random.Generator, size: int) -> np.ndarray:
    """Draw a uniform texture (size, size, 3)."""
    make = rng.choice(3, p=(0.55, 0.3, 0.15))
    return np.broadcast_to((pigment, pale, dark)[make](rng), (size, size, 3)).copy()
