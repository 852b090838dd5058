"""Specular light is hardly more coloured than the lamps: what is taken off a photo, held to that.

Problem: a network that judges each channel takes a highlight on green paint for green light, where
it is not sure: the paint's hue leaves with it.

Equation: white light s_c = l that is to change the diffuse layer D = I - s as little as possible in
its logarithm (to first order, log D moves by (l - s_c) / D_c) has

    l = sum_c (s_c / D_c^2) / sum_c (1 / D_c^2),

so that the darkest channel, which white light would empty first, decides. With t = `tint`, s_c is
brought to [l t^-1/2, l t^1/2], and below t min_c s_c where D_c has no room for that.

Citation: the dichromatic model, S. A. Shafer 1985, doi:10.1002/col.5080100409.

Limits: light of a stronger colour than t loses what exceeds it. Metals tint their highlights: not
meant.
"""

import numpy as np

_LEFT = 1e-3  # of a pixel's largest channel, and of each channel: what stays at least


def held_to_light(seen: np.ndarray, diffuse: np.ndarray, tint: float) -> np.ndarray:
    """The diffuse layer (H, W, 3) whose difference from `seen` (H, W, 3) >= `diffuse` is light of
    that colour; float32, >= 0.

    `tint` >= 1: the largest ratio of two of the light's channels.
    """
    taken = np.maximum(seen - diffuse, 0)
    weight = 1 / np.square(
        np.maximum(diffuse, _LEFT * np.maximum(seen.max(axis=2, keepdims=True), 1e-9))
    )
    level = (weight * taken).sum(axis=2, keepdims=True) / weight.sum(axis=2, keepdims=True)
    near = np.minimum(
        np.clip(taken, level / np.sqrt(tint), level * np.sqrt(tint)), (1 - _LEFT) * seen
    )
    light = np.minimum(near, tint * near.min(axis=2, keepdims=True))
    return (seen - light).astype(np.float32)
