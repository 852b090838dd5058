"""From what a method found at each pixel to the layers of a `Separation`, and how far they are trusted.

Inside the mask 0 <= diffuse <= image, whatever the method says; clipped pixels are explained by `clipped`. Confidence, for methods that
have none of their own, is exp(-e / u): e is the error of the specular light to be expected, what was removed plus a share of what could
still hide in the smallest channel; u is the mean of the smallest channel over the mask.
"""

import numpy as np

from ..decomposition import Separation
from .channels import mean_channel, smallest
from .clipped import explain_clipped

# A highlight can hide in a pixel's smallest channel; the share of it that stays in doubt where a method could decide.
DOUBT = 0.3


def white_layers(image: np.ndarray, mask: np.ndarray, specular: np.ndarray, clipped: np.ndarray | None = None) -> Separation:
    """The layers where `specular` (H, W), the same in all three channels, is taken off `image` (H, W, 3), but never below zero.

    What is not finite counts as 0. `mask`, `clipped`: (H, W) bool. The residual is 0 but where clipped.
    """
    low = smallest(image)
    white = np.where(mask & np.isfinite(specular), np.clip(specular, 0, low), 0).astype(np.float32)
    diffuse = np.where(mask[..., None], np.maximum(image - white[..., None], 0), 0).astype(np.float32)
    return _finished(image, mask, diffuse, np.repeat(white[..., None], 3, axis=2), clipped)


def diffuse_layers(image: np.ndarray, mask: np.ndarray, diffuse: np.ndarray, clipped: np.ndarray | None = None) -> Separation:
    """The layers where `diffuse` (H, W, 3), kept within [0, image], is all that stays: the specular layer may then be tinted.

    What is not finite counts as the image. `mask`, `clipped`: (H, W) bool. The residual is 0 but where clipped.
    """
    known = np.where(np.isfinite(diffuse), diffuse, image)
    kept = np.where(mask[..., None], np.clip(known, 0, image), 0).astype(np.float32)
    specular = np.where(mask[..., None], np.maximum(image - kept, 0), 0).astype(np.float32)
    return _finished(image, mask, kept, specular, clipped)


def _finished(image: np.ndarray, mask: np.ndarray, diffuse: np.ndarray, specular: np.ndarray, clipped: np.ndarray | None) -> Separation:
    low = np.where(mask, smallest(image), 0)
    base = max(float(low[mask].mean(dtype=float)), 1e-30) if mask.any() else 1.0
    error = mean_channel(specular) + DOUBT * low
    confidence = np.where(mask, np.exp(-error / base), 0).astype(np.float32)
    split = Separation(diffuse, specular, np.zeros_like(diffuse), confidence)
    return split if clipped is None else explain_clipped(split, clipped & mask, mask)
