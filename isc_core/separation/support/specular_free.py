"""Specular-free images: images of a photo that a white highlight does not change.

Problem: white light s (1, 1, 1) on top of a pixel D changes its colour. Which images of I = D + s
(1, 1, 1) equal those of D?

Equations, with min and max over the channels of a pixel:

    fixed chromaticity   I - w, w = (max I - c sum I) / (1 - 3 c): one largest chromaticity c
                         everywhere; keeps the hue, not the saturation
    two-band             I - min I: one channel is 0; keeps hue and chroma
    lifted two-band      I - min I + u, u the mean of min I over the object: no channel is 0, so
                         that chromaticities are defined
    modified             I - max(min I - T, 0), T = mean + eta deviations of min I: only what is
                         brighter than T changes
    less dark channel    I - dark, dark the smallest value of all channels in a patch

The first two are exact for every s >= 0, the third except for its one number u. The last two rest
on an assumption: that reflectance lies below T, or is dark in some channel near by.

Citation: R. T. Tan and K. Ikeuchi (2005), doi:10.1109/TPAMI.2005.36 (fixed chromaticity). K.-J.
Yoon, Y. Choi and I. S. Kweon (2006), doi:10.1109/ICIP.2006.312650 (two-band). H.-L. Shen and Z.-H.
Zheng (2013), doi:10.1364/AO.52.004483 (lifted). H.-L. Shen and Q.-Y. Cai (2009),
doi:10.1364/AO.48.002711 (modified). H. Kim, H. Jin, S. Hadap and I. Kweon (2013),
doi:10.1109/CVPR.2013.192 (dark channel).

Limits: the light must be white. All of them take grey reflectance for light. Images are (H, W, 3),
linear, not negative, of any exposure.
"""

import numpy as np

from ...filters.extrema import window_minimum
from ...imaging.channels import largest, smallest


def fixed_chromaticity(image: np.ndarray, chromaticity: float = 0.6) -> np.ndarray:
    """Return the image (H, W, 3) with one largest chromaticity wherever there is colour.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    chromaticity : float
        Above 1/3, at most 1.

    Returns
    -------
    (H, W, 3) ndarray
        Not negative.
    """
    total = image[..., 0] + image[..., 1] + image[..., 2]
    white = (largest(image) - chromaticity * total) / (1 - 3 * chromaticity)
    return np.maximum(image - white[..., None], 0)


def two_band(image: np.ndarray) -> np.ndarray:
    """Subtract the smallest channel from every channel of an image.

    Parameters
    ----------
    image : (H, W, 3) ndarray

    Returns
    -------
    (H, W, 3) ndarray
    """
    return image - smallest(image)[..., None]


def lifted_two_band(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the two-band image plus the mean of the smallest channel over a mask.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
        Not empty.

    Returns
    -------
    (H, W, 3) ndarray
    """
    return two_band(image) + smallest(image)[mask].mean(dtype=float)


def modified(image: np.ndarray, mask: np.ndarray, deviations: float = 0.5) -> np.ndarray:
    """Return the image less what its smallest channel has above T.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    deviations : float
        Standard deviations from the mean of the smallest channel to T.

    Returns
    -------
    (H, W, 3) ndarray
    """
    low = smallest(image)
    level = low[mask].mean(dtype=float) + deviations * low[mask].std(dtype=float)
    return image - np.maximum(low - level, 0)[..., None]


def dark_channel(low: np.ndarray, mask: np.ndarray, patch: int) -> np.ndarray:
    """Return the least value of the smallest channel in a patch.

    Parameters
    ----------
    low : (H, W) ndarray
        The smallest channel.
    mask : (H, W) bool ndarray
    patch : int
        Side in pixels.

    Returns
    -------
    (H, W) ndarray
        Infinite where the patch has no pixel of the mask.
    """
    return window_minimum(np.where(mask, low, np.inf), patch)


def less_dark_channel(image: np.ndarray, mask: np.ndarray, patch: int = 7) -> np.ndarray:
    """Return the image less its dark channel; 0 outside `mask`.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    patch : int
        Side in pixels.

    Returns
    -------
    (H, W, 3) ndarray
    """
    dark = np.where(mask, dark_channel(smallest(image), mask, patch), 0)
    return np.where(mask[..., None], image - dark[..., None], 0)
