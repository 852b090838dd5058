"""The maps of an object from which the candidates for specular light are computed.

Equation: a pixel is I = D + s (1, 1, 1). With C = max I - min I and the diffuse ratio q = min D /
(max D - min D), s = min I - q C.

Limits: see the package.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...imaging.blocks import padded_means_inside
from ...imaging.channels import largest, smallest
from ...imaging.smoothing import masked_gaussian
from ..support.highlight_cues import far_from_borders, noise_level, steps_of
from ..support.hue_grid import hue_of

TINY = np.float32(1e-9)
CHROMA_STEP = 0.5  # of log C: an edge
DARK = 0.03  # of the brightest value: C below is noise
SMOOTH_REACH = 3  # pixels, at least, of the smoothing
_SIGMA = 0.7  # of the smoothing, pixels


@dataclass(frozen=True, eq=False)
class ObjectMaps:
    """The object at one scale.

    Attributes
    ----------
    image : (H, W, 3) float32 ndarray
    mask, usable : (H, W) bool ndarray
        `usable` where the sensor was not clipped.
    low, high, hue : (H, W) float32 ndarray
        Of the smoothed image: min I, max I, and the hue.
    """

    image: np.ndarray
    mask: np.ndarray
    usable: np.ndarray
    low: np.ndarray
    high: np.ndarray
    hue: np.ndarray

    @cached_property
    def peak(self) -> float:
        """The brightest value."""
        return peak_of(self.image, self.mask)

    @cached_property
    def base(self) -> float:
        """The mean of `low`."""
        return base_of(self.low, self.mask, self.peak)

    @cached_property
    def noise(self) -> float:
        """The standard deviation of the image's noise."""
        return noise_level(self.image, self.mask)

    @cached_property
    def chroma(self) -> np.ndarray:
        """C = max I - min I (H, W)."""
        return self.high - self.low

    def rows(self, rows: slice) -> "ObjectMaps":
        """Return some rows.

        Parameters
        ----------
        rows : slice

        Returns
        -------
        ObjectMaps
        """
        maps = self.image, self.mask, self.usable, self.low, self.high, self.hue
        return ObjectMaps(*(one[rows] for one in maps))

    @property
    def diagonal(self) -> float:
        """The length of the frame's diagonal, pixels."""
        rows, columns = self.mask.shape
        return float(np.hypot(rows, columns))


def object_maps(image: np.ndarray, mask: np.ndarray, usable: np.ndarray) -> ObjectMaps:
    """Smooth an image for the ratios by hue.

    Parameters
    ----------
    image : (H, W, 3) float32 ndarray
    mask, usable : (H, W) bool ndarray
        See `ObjectMaps`.

    Returns
    -------
    ObjectMaps
    """
    smooth = np.where(mask[..., None], masked_gaussian(image, mask, _SIGMA), 0)
    low, high = smallest(smooth), largest(smooth)
    return ObjectMaps(image, mask, usable, low, high, hue_of(smooth, low, high))


def block_averages(
    image: np.ndarray, mask: np.ndarray, usable: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Downsample the maps of an object.

    Parameters
    ----------
    image : (H, W, 3) float32 ndarray
    mask, usable : (H, W) bool ndarray
    factor : int
        Side of the square blocks, pixels.

    Returns
    -------
    image : (h, w, 3) ndarray
        Means of the mask's pixels.
    mask : (h, w) bool ndarray
        Blocks of which more than half lies in the mask.
    usable : (h, w) bool ndarray
        Those of which all pixels are usable.
    """
    if factor == 1:
        return image, mask, usable
    planes = [padded_means_inside(image[..., c], mask, factor)[0] for c in range(3)]
    clipped, covered = padded_means_inside((~usable).astype(np.float32), mask, factor)
    inside = covered > 0.5 if (covered > 0.5).any() else covered > 0
    return np.where(inside[..., None], np.stack(planes, axis=2), 0), inside, inside & (clipped == 0)


def specular_of(low: np.ndarray, chroma: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return s = min I - q C.

    Parameters
    ----------
    low, chroma : (...) ndarray
        min I and C.
    share : (...) ndarray
        min D / max D.

    Returns
    -------
    (...) ndarray
        Within [0, min I].
    """
    return np.clip(low - ratio_of(share) * chroma, 0, low)


def ratio_of(share: np.ndarray) -> np.ndarray:
    """Return the diffuse ratio q = min D / (max D - min D).

    Parameters
    ----------
    share : (...) ndarray
        min D / max D.

    Returns
    -------
    (...) ndarray
        At most 100.
    """
    return share / np.maximum(1 - share, np.float32(0.01))


def edge_weights(photo: ObjectMaps) -> np.ndarray:
    """Return the weights of pixels far from edges of C.

    Parameters
    ----------
    photo : ObjectMaps

    Returns
    -------
    (H, W) ndarray
        In [0, 1].
    """
    level = photo.chroma + DARK * photo.peak
    # Three standard deviations of the difference of two neighbours; smoothing reduces their noise
    # to a third.
    floor = 3 * 0.3 * 1.4 * photo.noise / level / CHROMA_STEP
    steps = steps_of([(np.log(level), CHROMA_STEP)], photo.mask, floor)
    return far_from_borders(steps, photo.mask, blur=1.5, unit=0.6)


def peak_of(image: np.ndarray, mask: np.ndarray) -> float:
    """Return the brightest value of an object, without a thousandth of outliers.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    float
        Positive.
    """
    return max(float(np.quantile(image[mask], 0.999)), float(TINY))


def base_of(low: np.ndarray, mask: np.ndarray, peak: float) -> float:
    """Return the mean of min I.

    Parameters
    ----------
    low : (H, W) ndarray
        min I.
    mask : (H, W) bool ndarray
    peak : float
        The brightest value.

    Returns
    -------
    float
        Positive.
    """
    return max(float(low[mask].mean(dtype=float)), float(TINY) * peak)
