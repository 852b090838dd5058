"""What a separation says about clipped pixels, whose true value lies above the recorded one.

Problem: where the sensor is full, image = diffuse + white specular no longer holds, and equations that rely on colour
differences turn highlights' cores into black holes. Instead the diffuse layer is carried in from around the clipped region by
pull-push interpolation (see `inpainting.pull_push`).

Limits: texture under a clipped highlight is lost; the fill is smooth.
"""

import numpy as np

from ..decomposition import Separation
from ..inpainting.pull_push import fill


def explain_clipped(split: Separation, clipped: np.ndarray, mask: np.ndarray) -> Separation:
    """The same split with clipped pixels refilled; `clipped` and `mask` (H, W) bool.

    There diffuse is carried in from the mask's other pixels, but never above the recorded value; specular is the white that the
    least clipped channel shows on top; the residual (<= 0) is the light that the full channels lost; confidence is 0. A mask
    without any unclipped pixel keeps its split.
    """
    known = mask & ~clipped
    if not clipped.any() or not known.any():
        return split
    image = split.diffuse + split.specular + split.residual
    around = fill(split.diffuse, known)
    diffuse, specular, residual = split.diffuse.copy(), split.specular.copy(), split.residual.copy()
    diffuse[clipped] = np.minimum(around[clipped], image[clipped])
    rest = image[clipped] - diffuse[clipped]
    specular[clipped] = rest.max(axis=1, keepdims=True)
    residual[clipped] = rest - specular[clipped]
    return Separation(diffuse, specular, residual, np.where(clipped, np.float32(0), split.confidence))
