"""Foreground colours at the soft rim of an object, without the background.

Problem: a pixel of the outline shows object and background, I = a F + (1 - a) B for its coverage a.
If it is taken for the object, the background distorts shape and colours there.

Equation: with means over a window, f = mean(a^8 I) / mean(a^8) and b the same for 1 - a, so that
pure pixels have the largest weights, F = f + a (I - a f - (1 - a) b).

Citation: M. Forte, "Approximate fast foreground colour estimation", ICIP 2021,
doi:10.1109/ICIP42928.2021.9506164.

Limits: a single step, on a downscaled photo, with powers of a instead of a: colours that vary
within the window are averaged.
"""

import numpy as np
from scipy import ndimage

from ..imaging.bounding_box import mask_slices
from ..imaging.resampling import resampled

_SOLVED = 512  # pixels of the longer side on which means are taken
_WINDOW = 9  # of these pixels
_POWER = 8
_LEAST = 1e-6


def estimate_foreground(image: np.ndarray, cover: np.ndarray) -> np.ndarray:
    """Replace the colours at the rim of an object by foreground colours.

    Parameters
    ----------
    image : (H, W, 3) float32 ndarray
        Linear.
    cover : (H, W) float32 ndarray
        0 to 1.

    Returns
    -------
    (H, W, 3) float32 ndarray
        The image, changed where the coverage is at least half, but below 1.
    """
    rim = (cover >= 0.5) & (cover < 1)
    if not rim.any():
        return image
    place = mask_slices(cover > 0)
    part, share = image[place], cover[place]
    height, width = share.shape
    factor = min(1.0, _SOLVED / max(height, width))
    size = max(round(height * factor), 1), max(round(width * factor), 1)
    small, a = resampled(part, size), resampled(share, size)[..., None]
    front, back = _means(small, a**_POWER), _means(small, (1 - a) ** _POWER)
    rows, columns = np.nonzero(rim[place])
    at = (rows * size[0]) // height, (columns * size[1]) // width
    a, seen = share[rows, columns][:, None], part[rows, columns]
    colours = front[at] + a * (seen - a * front[at] - (1 - a) * back[at])
    result = image.copy()
    result[place][rows, columns] = np.maximum(colours, 0)
    return result


def _means(image: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Weighted means over windows."""
    size = (_WINDOW, _WINDOW, 1)
    total = ndimage.uniform_filter(image * weight, size)
    return np.asarray(total / np.maximum(ndimage.uniform_filter(weight, size), _LEAST))
