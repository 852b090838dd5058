"""Images of a photo that a white highlight does not reach: what the methods of separation compare
the photo with.

Problem: white light s (1, 1, 1) on top of a pixel D changes its colour. Which images of I = D + s
(1, 1, 1) are the same as those of D?

Equations, with min and max over the channels of a pixel: fixed chromaticity   I - w,  w = (max I -
c sum I) / (1 - 3 c): one largest chromaticity c everywhere; keeps the hue, not the saturation;
two-band             I - min I: one channel is 0; keeps hue and chroma; lifted two-band      I - min
I + u,  u the mean of min I over the object: no channel is 0, so that chromaticities are defined;
modified             I - max(min I - T, 0),  T = mean + eta deviations of min I: only what is
brighter than T loses anything; less dark channel    I - dark,  dark the smallest value of all
channels in a patch. The first two are exact for every s >= 0, the third but for its one number u.
The last two rest on an assumption: that paint lies below T, or is dark in some channel near by.

Citation: R. T. Tan and K. Ikeuchi (2005), doi:10.1109/TPAMI.2005.36 (fixed chromaticity). K.-J.
Yoon, Y. Choi and I. S. Kweon (2006), doi:10.1109/ICIP.2006.312650 (two-band). H.-L. Shen and Z.-H.
Zheng (2013), doi:10.1364/AO.52.004483 (lifted). H.-L. Shen and Q.-Y. Cai (2009),
doi:10.1364/AO.48.002711 (modified). H. Kim, H. Jin, S. Hadap and I. Kweon (2013),
doi:10.1109/CVPR.2013.192 (dark channel).

Limits: the light must be white. All of them take grey paint for light. Images are (H, W, 3),
linear, >= 0, at any exposure.
"""

import numpy as np
from scipy import ndimage

from ...imaging.channels import largest, smallest


def fixed_chromaticity(image: np.ndarray, chromaticity: float = 0.6) -> np.ndarray:
    """(H, W, 3) >= 0 whose largest chromaticity is `chromaticity` wherever there is colour; above
    1/3, at most 1.
    """
    total = image[..., 0] + image[..., 1] + image[..., 2]
    white = (largest(image) - chromaticity * total) / (1 - 3 * chromaticity)
    return np.maximum(image - white[..., None], 0)


def two_band(image: np.ndarray) -> np.ndarray:
    """(H, W, 3) >= 0 whose smallest channel is 0."""
    return image - smallest(image)[..., None]


def lifted_two_band(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The two-band image with the mean u of the smallest channel over `mask` (H, W) bool in its
    place.
    """
    return two_band(image) + smallest(image)[mask].mean(dtype=float)


def modified(image: np.ndarray, mask: np.ndarray, deviations: float = 0.5) -> np.ndarray:
    """The image less what its smallest channel has above T, the mean plus `deviations` standard
    deviations of it over `mask`.
    """
    low = smallest(image)
    level = low[mask].mean(dtype=float) + deviations * low[mask].std(dtype=float)
    return image - np.maximum(low - level, 0)[..., None]


def dark_channel(low: np.ndarray, mask: np.ndarray, patch: int) -> np.ndarray:
    """The least value (H, W) of the smallest channel `low` (H, W) over the pixels of `mask` in a
    square of `patch` pixels a side around each pixel; infinite where there is none.
    """
    return ndimage.minimum_filter(np.where(mask, low, np.inf), patch, mode="nearest")


def less_dark_channel(image: np.ndarray, mask: np.ndarray, patch: int = 7) -> np.ndarray:
    """The image less its dark channel; 0 outside `mask`."""
    dark = np.where(mask, dark_channel(smallest(image), mask, patch), 0)
    return np.where(mask[..., None], image - dark[..., None], 0)
