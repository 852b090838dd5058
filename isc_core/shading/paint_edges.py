"""Edges of paint, from the colours of neighbouring pixels.

Problem: at an edge of paint, fine changes of brightness are no evidence of relief.

Equation: pixels of one paint are alike in the guide

    g = (log R/G, log B/G, k (I - S)),

with the light's channels R, G and B (and a little of the mean light, since the chroma of the dark
is noise), the log light I and the log shading S of the smooth surface. Relief hardly changes
chroma, and changes brightness less than most print does: k is small. With the range e of g over the
3 x 3 pixels around a pixel, the paint is uniform by exp(-e^2 / (2 w^2)).

Pixels of one paint far from each other are alike in the same features of I - S, that is, without
the colours of a light that differ across the object.

The numbers were chosen on the validation set of `benchmarks.detail.sets`.

Citation: none; that chroma distinguishes paint from shading is classical: B. V. Funt, M. S. Drew,
M. Brockington, "Recovering shading from color images", ECCV 1992, doi:10.1007/3-540-55426-2_15.

Limits: print whose brightness changes by less than a tenth and whose colour does not, such as the
grain of wood, looks uniform; so does paint under light of a colour that hides it.
"""

import numpy as np

from ..filters.extrema import window_maximum, window_minimum
from ..imaging.channels import total
from ..imaging.smoothing import masked_gaussian

ONE_PAINT = 0.1  # deviation of g within one paint
_EDGE = 0.15  # w above
_CONTRAST = 0.2  # k above
_MOST_CONTRAST = 2.0  # of I - S
_DIM = 0.05  # of the object's mean light
_BLUR = 0.7  # of chroma, pixels


def paint_guide(image: np.ndarray, mask: np.ndarray, contrast: np.ndarray) -> np.ndarray:
    """Return features in which neighbours of one paint are alike, g of the module.

    Parameters
    ----------
    image : (H, W, 3) float32 ndarray
        Linear diffuse light over the object's mean.
    mask : (H, W) bool ndarray
    contrast : (H, W) float32 ndarray
        Log light less log shading, I - S.

    Returns
    -------
    (H, W, 3) float32 ndarray
        0 outside of the mask.
    """
    light = np.log(image + np.float32(_DIM))
    chroma = np.where(mask[..., None], light[..., ::2] - light[..., 1:2], 0)
    chroma = masked_gaussian(chroma, mask, _BLUR)
    brightness = np.float32(_CONTRAST) * np.clip(contrast, -_MOST_CONTRAST, _MOST_CONTRAST)
    return np.concatenate([chroma, brightness[..., None]], axis=2) * mask[..., None]


def paint_features(contrasts: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return features in which pixels of one paint are alike across the object.

    Parameters
    ----------
    contrasts : (3, H, W) float32 ndarray
        I - S of the mean light, of log R/G and of log B/G.
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W, 3) float32 ndarray
        0 outside of the mask.
    """
    brightness, *chroma = np.clip(contrasts, -_MOST_CONTRAST, _MOST_CONTRAST)
    smooth = [masked_gaussian(one, mask, _BLUR) for one in chroma]
    return np.stack([*smooth, np.float32(_CONTRAST) * brightness], axis=2) * mask[..., None]


def uniformity(guide: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return how far there is one paint around each pixel.

    Parameters
    ----------
    guide : (H, W, C) float32 ndarray
        Of `paint_guide`.
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W) float32 ndarray
        In [0, 1]; 1 outside of the mask.
    """
    far, inside = np.float32(1e3), mask[..., None]
    highest = window_maximum(np.where(inside, guide, -far), 3)
    lowest = window_minimum(np.where(inside, guide, far), 3)
    ranges = total(np.square(np.where(inside, highest - lowest, 0)))
    return np.asarray(np.exp(-ranges / np.float32(2 * _EDGE**2)))
