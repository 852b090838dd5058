"""What a separation says about clipped pixels, whose true value lies above the recorded one.

Problem: where the sensor is full, image = diffuse + white specular no longer holds, and equations that rely on colour
differences turn highlights' cores into black holes. Instead the diffuse layer is carried in from around the clipped region by
the pull-push interpolation of S. J. Gortler et al., "The Lumigraph", SIGGRAPH 1996, doi:10.1145/237170.237200: known pixels
are averaged down a pyramid, and holes take the average of the finest level that knows anything. It is linear in the pixels.

Limits: texture under a clipped highlight is lost; the fill is smooth.
"""

import numpy as np

from ..decomposition import Separation


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


def fill(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """`values` (H, W, C) with all pixels that are not `known` (H, W) bool interpolated; at least one pixel must be known."""
    return _pull_push(np.where(known[..., None], values, 0).astype(np.float32), known.astype(np.float32))


def _pull_push(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    if weight.all():
        return values
    coarse_values, coarse_weight = _pull(values, weight)
    pushed = _push(_pull_push(coarse_values, coarse_weight), weight.shape)
    return np.where(weight[..., None] > 0, values, pushed)


def _pull(values: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Averages of 2 x 2 blocks over their known pixels; a block is known if any of its pixels is."""
    odd = [(0, n % 2) for n in weight.shape]
    v, w = np.pad(values, [*odd, (0, 0)]), np.pad(weight, odd)
    blocks = (v.shape[0] // 2, 2, v.shape[1] // 2, 2)
    total = w.reshape(blocks).sum(axis=(1, 3))
    mean = (v * w[..., None]).reshape(*blocks, -1).sum(axis=(1, 3)) / np.maximum(total, 1)[..., None]
    return mean, (total > 0).astype(np.float32)


def _push(coarse: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Bilinear doubling, pixel centres aligned: each fine pixel is 3/4 of its block's value and 1/4 of the next one's."""
    for axis in (0, 1):
        last = coarse.shape[axis] - 1
        at = np.arange(shape[axis])
        near = at // 2
        next_ = np.clip(np.where(at % 2, near + 1, near - 1), 0, last)
        coarse = 0.75 * np.take(coarse, near, axis=axis) + 0.25 * np.take(coarse, next_, axis=axis)
    return coarse.astype(np.float32)
