"""The trivial baseline: a flat shape without light, so that reflectance = image."""

import numpy as np

from .from_shading import BaselineEstimate, check_log_image


def estimate(log_image: np.ndarray, mask: np.ndarray) -> BaselineEstimate:
    """Return a flat shape.

    Parameters
    ----------
    log_image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    BaselineEstimate

    Raises
    ------
    InputError
        For arrays of wrong shapes or an empty mask.
    """
    check_log_image(log_image, mask)
    return BaselineEstimate(np.zeros(mask.shape), np.zeros(log_image.shape), np.zeros((9, 3)))
