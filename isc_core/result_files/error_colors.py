"""Colours for expected errors of normals: blue (small), green, yellow, red (large)."""

import numpy as np

# Degrees, and the colour in sRGB codes; colours are interpolated over the logarithm.
SCALE = (
    (10, (54, 110, 214)),
    (20, (66, 178, 150)),
    (30, (236, 200, 84)),
    (45, (214, 72, 58)),
)


def error_colors(degrees: np.ndarray) -> np.ndarray:
    """Return the colours of errors.

    Parameters
    ----------
    degrees : (...) ndarray
        At least 0; errors beyond the scale have the colours of its ends.

    Returns
    -------
    (..., 3) ndarray
        sRGB codes over 255.
    """
    steps = np.log([step for step, _ in SCALE])
    codes = np.array([code for _, code in SCALE]) / 255
    place = np.log(np.maximum(degrees, SCALE[0][0]))
    return np.stack([np.interp(place, steps, channel) for channel in codes.T], axis=-1)
