"""The identity, diffuse = image: the baseline of every comparison of separations."""

import numpy as np

from ..scene.decomposition import Separation
from .support.checks import check_arrays


def separate(image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None) -> Separation:
    """Return the image as the diffuse layer; the confidence is 1 in the mask, 0 where clipped.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    clipped : (H, W) bool ndarray, optional

    Returns
    -------
    Separation

    Raises
    ------
    InputError
        If shapes are invalid, the mask is empty, or values inside it are negative or not finite.
    """
    check_arrays(image, mask, clipped)
    unclipped = mask if clipped is None else mask & ~clipped
    diffuse = np.where(mask[..., None], image, 0).astype(np.float32)
    return Separation(
        diffuse, np.zeros_like(diffuse), np.zeros_like(diffuse), unclipped.astype(np.float32)
    )
