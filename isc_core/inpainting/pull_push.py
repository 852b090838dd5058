"""Fills an image's unknown pixels smoothly from its known ones (the pull-push interpolation of Gortler et al. 1996).

Problem: values known at some pixels, everywhere wanted. Equation: known pixels are averaged over 2 x 2 blocks down a pyramid (pull); from
the top, holes take the bilinear interpolation of the finest level that knows anything (push). It is linear in the pixels.

Citation: S. J. Gortler, R. Grzeszczuk, R. Szeliski and M. F. Cohen, "The Lumigraph", SIGGRAPH 1996, 43-54, doi:10.1145/237170.237200.

Limits: texture does not continue into a hole; the fill is smooth.
"""

import numpy as np


def fill(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """`values` (H, W, C) with all pixels that are not `known` (H, W) bool interpolated, as float32; at least one must be known."""
    return _pull_push(np.where(known[..., None], values, 0).astype(np.float32), known.astype(np.float32))


def _pull_push(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    if weight.all():
        return values
    coarse_values, coarse_weight = pull(values, weight)
    pushed = push(_pull_push(coarse_values, coarse_weight), weight.shape)
    return np.where(weight[..., None] > 0, values, pushed)


def pull(values: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Averages of 2 x 2 blocks over their known pixels; a block is known if any of its pixels is."""
    odd = [(0, n % 2) for n in weight.shape]
    v, w = np.pad(values, [*odd, (0, 0)]), np.pad(weight, odd)
    blocks = (v.shape[0] // 2, 2, v.shape[1] // 2, 2)
    total = w.reshape(blocks).sum(axis=(1, 3))
    mean = (v * w[..., None]).reshape(*blocks, -1).sum(axis=(1, 3)) / np.maximum(total, 1)[..., None]
    return mean, (total > 0).astype(np.float32)


def push(coarse: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Bilinear doubling, pixel centres aligned: each fine pixel is 3/4 of its block's value and 1/4 of the next one's."""
    for axis in (0, 1):
        last = coarse.shape[axis] - 1
        at = np.arange(shape[axis])
        near = at // 2
        next_ = np.clip(np.where(at % 2, near + 1, near - 1), 0, last)
        coarse = 0.75 * np.take(coarse, near, axis=axis) + 0.25 * np.take(coarse, next_, axis=axis)
    return coarse.astype(np.float32)
