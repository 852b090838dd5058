"""The base colour at the photo's own resolution.

Problem: the maps may be smaller than the photo, whose texture the object should keep.

Equation: with image I and diffuse layer D of the maps, k R their base colour and P the photo,

    base colour = P up(w k R / I) + (1 - up(w)) up(k R),   w = (D / I)^2,

w being 0 in the dark and at the object's edge, up bilinear: shading and the share of the highlights
are as smooth as the maps, the detail is the photo's; below highlights, where the photo's detail is
theirs, it is that of the maps.

Citation: ratios of images as a transfer of detail: Z. Liu, Y. Shan and Z. Zhang,
"Expressive expression mapping with ratio images", SIGGRAPH 2001, doi:10.1145/383259.383289.

Limits: edges of shadows finer than a pixel of the maps stay in the texture, and where the ratio
jumps from pixel to pixel of the maps so does the texture.
"""

import numpy as np
from scipy import ndimage

from ..imaging.upsampling import enlarged
from .mesh import color_codes

_DARK = 1e-3  # of the brightest


def photo_base_color(
    image: np.ndarray, diffuse: np.ndarray, base_color: np.ndarray, photo: np.ndarray, scale: float
) -> np.ndarray:
    """Return the base colour at the photo's resolution.

    Parameters
    ----------
    image, diffuse : (h, w, 3) ndarray
        Of the maps, linear.
    base_color : (h, w, 3) ndarray
        Of the mesh, linear, continued beyond the mask.
    photo : (H, W, 3) ndarray
        Linear.
    scale : float
        Map pixels per photo pixel, below 1.

    Returns
    -------
    (P, Q, 3) uint8 ndarray
        sRGB codes. Its frame is that of the maps, whose last pixels may reach beyond the photo.
    """
    sizes = zip(photo.shape[:2], image.shape[:2], strict=True)
    frame = [max(pixels, round(size / scale)) for pixels, size in sizes]
    beyond = [(0, f - n) for f, n in zip(frame, photo.shape[:2], strict=True)]
    floor = _DARK * float(image.max())
    ratio = base_color / np.maximum(image, floor)
    # The photo's pixels at the object's edge show what is behind it, too.
    within = ndimage.binary_erosion((image > 0).any(-1), np.ones((3, 3)))[..., None]
    share = np.clip(diffuse / np.maximum(image, floor), 0, 1) ** 2
    weight = np.where(within & (image > floor), share, 0)
    codes = np.empty((*frame, 3), np.uint8)
    for channel in range(3):  # so that no large array is made for all
        planes = [values[..., channel] for values in (weight * ratio, weight, base_color)]
        up = enlarged(np.stack(planes, -1).astype(np.float32), (frame[0], frame[1]), 1 / scale)
        detail = np.pad(photo[..., channel], beyond, mode="edge")
        fine = detail * up[..., 0] + (1 - up[..., 1]) * up[..., 2]
        codes[..., channel] = color_codes(fine)
    return codes
