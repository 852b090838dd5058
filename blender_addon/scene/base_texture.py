"""The base colour as a texture of the size that the user chose.

Limits: sRGB codes of 8 bits where it is finer than the maps. No texture is enlarged.
"""

import numpy as np

from isc_core.imaging.area_resize import AreaFilter
from isc_core.imaging.srgb import srgb_to_linear

from ..files.result_arrays import ResultArrays


def base_texture(result: ResultArrays, size: int) -> np.ndarray:
    """Return the base colour at the photo's resolution, reduced where it is larger than wanted.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size : int
        The most pixels of the longer side; 0 for the photo's.

    Returns
    -------
    (P, Q, 3) ndarray of float32
        Linear.
    """
    codes = result.photo_base_color
    if codes is None:
        return result.base_color
    linear = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
    scale = size / max(codes.shape) if size else 1.0
    if scale >= 1:
        return linear[codes]
    if size <= max(result.size):
        return result.base_color
    area = AreaFilter.of(codes.shape[:2], scale)
    planes = [area(linear[codes[..., c]]) / area.full for c in range(3)]
    return np.stack(planes, -1).astype(np.float32)
