"""The row that every table of separations needs: nothing is removed, diffuse = image."""

import numpy as np

from ..scene.decomposition import Separation
from .support.checks import check_arrays


def separate(image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None) -> Separation:
    """`image` (H, W, 3) and `mask` (H, W) bool as everywhere. Confidence is 1 in the mask, 0 where
    `clipped`.

    Raises `InputError` for unfit shapes, an empty mask, or values inside the mask that are negative
    or not finite.
    """
    check_arrays(image, mask, clipped)
    trusted = mask if clipped is None else mask & ~clipped
    diffuse = np.where(mask[..., None], image, 0).astype(np.float32)
    return Separation(
        diffuse, np.zeros_like(diffuse), np.zeros_like(diffuse), trusted.astype(np.float32)
    )
