"""Gaussian averages of an image.

Equation: the convolution with g(y) g(x), g(k) = exp(-k^2 / (2 sigma^2)) / sum, cut off at a number
of standard deviations. Beyond its border the image is mirrored, or zero (see `separable`).

Limits: the time of a pixel is proportional to sigma.
"""

import numpy as np

from .separable import separable_average

_CUT = 4.0  # standard deviations


def gaussian_average(
    image: np.ndarray, sigma: float, *, cut: float = _CUT, mirrored: bool = True
) -> np.ndarray:
    """Average an image by a Gaussian.

    Parameters
    ----------
    image : (H, W) float32 or float64 ndarray
    sigma : float
        Standard deviation in pixels.
    cut : float
        Standard deviations at which the Gaussian is cut off.
    mirrored : bool
        Whether the image is mirrored at its border; otherwise it is zero beyond.

    Returns
    -------
    (H, W) ndarray
        Of the image's type.
    """
    return separable_average(image, gaussian_taps(sigma, cut), mirrored=mirrored)


def gaussian_taps(sigma: float, cut: float = _CUT) -> np.ndarray:
    """Return the weights of a Gaussian average from its centre outwards.

    Parameters
    ----------
    sigma : float
        Standard deviation in pixels.
    cut : float
        Standard deviations at which the Gaussian is cut off.

    Returns
    -------
    (radius + 1,) ndarray
        The weights of both sides and the centre have the sum 1.
    """
    radius = int(cut * sigma + 0.5)
    offsets = np.arange(-radius, radius + 1)
    weights = np.exp(-0.5 / (sigma * sigma) * offsets**2)
    return np.asarray((weights / weights.sum())[radius:])
