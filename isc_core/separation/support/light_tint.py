"""A limit on the colour of the removed light.

Specular light is hardly more coloured than its sources.

Problem: a network that estimates each channel mistakes a highlight on green reflectance for green
light, where it is uncertain: the hue of the reflectance vanishes with it.

Equation: white light s_c = l that changes the diffuse layer D = I - s as little as possible in its
logarithm (to first order, log D moves by (l - s_c) / D_c) has

    l = sum_c (s_c / D_c^2) / sum_c (1 / D_c^2),

so that the darkest channel, which white light would empty first, decides. With t = `tint`, s_c is
clamped to [l t^-1/2, l t^1/2], and below t min_c s_c where D_c has no room for that.

Citation: the dichromatic model, S. A. Shafer 1985, doi:10.1002/col.5080100409.

Limits: light more coloured than t loses the excess. Metals, which tint their highlights, are not
covered.
"""

import numpy as np

from ...imaging.channels import largest, smallest, total

_MIN_SHARE = 1e-3  # of a pixel's largest channel, and of each channel: least diffuse value


def limit_tint(image: np.ndarray, diffuse: np.ndarray, tint: float) -> np.ndarray:
    """Return the diffuse layer whose difference from the photo has the colour of light.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        The photo.
    diffuse : (H, W, 3) ndarray
        Not above `image`.
    tint : float
        Largest ratio of two of the light's channels, at least 1.

    Returns
    -------
    (H, W, 3) float32 ndarray
        Not negative.
    """
    removed = np.maximum(image - diffuse, 0)
    weight = 1 / np.square(
        np.maximum(diffuse, _MIN_SHARE * np.maximum(largest(image)[..., None], 1e-9))
    )
    level = (total(weight * removed) / total(weight))[..., None]
    near = np.minimum(
        np.clip(removed, level / np.sqrt(tint), level * np.sqrt(tint)), (1 - _MIN_SHARE) * image
    )
    light = np.minimum(near, tint * smallest(near)[..., None])
    return (image - light).astype(np.float32)
