"""A white for float files, which have none.

Problem: floats may hold highlights thousands of times as bright as the object, as renderers and
merged exposures have them. No camera records those in one photo, and statistics of the whole
object, such as its mean light, would describe the highlight alone.

Equation: white is `HEADROOM` times the 80th percentile of the object's largest channels. Brighter
pixels keep their chromaticity, and have white as their largest channel; like the clipped pixels of
a camera's file, they were at least as bright.

Limits: light above white is missing in the specular layer. That of a lamp in a surface of the
roughness alpha < .015 may be (GGX, Fresnel .04, albedo .5). Without colour, a highlight stays where
all others do. Where highlights cover a fifth of the
object, the percentile is theirs, and nothing is limited.
"""

import numpy as np

from ..imaging.channels import largest

# Photos with highlights of 100 times the percentile are still separated like others, and white
# print on black is at most some 50 times as bright.
HEADROOM, _PERCENTILE = 64.0, 80.0


def limit_to_white(light: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Limit the object's light to white.

    Parameters
    ----------
    light : (H, W, 3) ndarray
        Linear, finite and not negative on the object.
    mask : (H, W) bool ndarray
        The object.

    Returns
    -------
    light : (H, W, 3) ndarray
        The same array where nothing exceeds white.
    above : (H, W) bool ndarray
        The object's pixels that were brighter.
    """
    brightest = largest(light)
    inside = brightest[mask]
    lit = inside[inside > 0]
    white = HEADROOM * float(np.percentile(lit, _PERCENTILE)) if lit.size else np.inf
    above = mask & (brightest > white)
    if above.any():
        light = light.copy()
        light[above] *= (np.float32(white) / brightest[above])[:, None]
    return light, above
