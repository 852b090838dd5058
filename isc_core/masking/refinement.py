"""The outline of a mask at the photo's own pixels.

Problem: the network sees 96 pixels; the outline that it finds is off by up to one of them.

Equation: pixels of which the network is certain and that lie away from the outline are fixed. So is
the medial axis of the object, so that thin parts are kept. GrabCut labels all other pixels by
colour and contrast (`photo.grabcut`). The coverage a of the rim is the guided filter of the labels
with the photo as its guide, a = A I + b in windows of a few pixels.

Citation: C. Rother et al. 2004, doi:10.1145/1015706.1015720; K. He, J. Sun, X. Tang 2013,
doi:10.1109/TPAMI.2012.213 (section 4, feathering).

Limits: solved on at most `SIDE` pixels of the longer side of the object's surroundings.
"""

import numpy as np
from scipy import ndimage

from ..imaging.guided_filter import affine_fit
from ..imaging.resampling import resampled
from ..imaging.srgb import srgb_codes
from ..photo.grabcut import Label, segmented
from ..photo.masks import tidy_mask

SIDE = 384
_SURE = 0.97  # probability from which the network is trusted, away from the outline
_LIKELY = 0.8  # the same on the middle line of the object
_LINE = 5  # pixels: no point of the middle line lies less deep than others as near
_BAND = 0.03  # of the part's longer side: as far off as the network's outline may be
_ITERATIONS = 1
_EPSILON = 1e-3  # of the guided filter, for sRGB codes in [0, 1]


def refined(light: np.ndarray, cover: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Refine the network's mask.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
        Linear; the part of the photo that holds the object.
    cover : (H, W) float32 ndarray
        The network's probabilities.
    known : (H, W) int8 ndarray
        1 where the user says that the object is, -1 where it is not, else 0.

    Returns
    -------
    (H, W) float32 ndarray
        Cover, 0 to 1, at the size of `light`.
    """
    height, width = cover.shape
    factor = min(1.0, SIDE / max(width, height))
    small = round(height * factor), round(width * factor)
    codes = srgb_codes(resampled(light, small))
    soft = soft_cover(codes, resampled(cover, small), _nearest(known, small))
    return resampled(soft, (height, width))


def _nearest(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    height, width = shape
    rows = (np.arange(height) + 0.5) * (values.shape[0] / height)
    columns = (np.arange(width) + 0.5) * (values.shape[1] / width)
    return values[rows.astype(int)[:, None], columns.astype(int)]


def soft_cover(codes: np.ndarray, cover: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Label the pixels near the outline, and soften it.

    Parameters
    ----------
    codes : (H, W, 3) uint8 ndarray
    cover : (H, W) float32 ndarray
    known : (H, W) int8 ndarray
        See `refined`.

    Returns
    -------
    (H, W) float32 ndarray
        0 where the network is sure of no pixel.
    """
    labels = trimap(cover, known)
    if not (labels == Label.OBJECT).any():
        return np.zeros_like(cover)
    if not (labels == Label.BACKGROUND).any():
        return cover
    mask = tidy_mask(segmented(codes, labels, _ITERATIONS))
    return feathered(codes, mask)


def trimap(cover: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return what is known of each pixel.

    Parameters
    ----------
    cover : (H, W) float32 ndarray
    known : (H, W) int8 ndarray
        See `refined`.

    Returns
    -------
    (H, W) uint8 ndarray
        Of `Label`.
    """
    band = _BAND * max(cover.shape)
    inside = cover > 0.5
    labels = np.where(inside, Label.PROBABLY_OBJECT, Label.PROBABLY_BACKGROUND).astype(np.uint8)
    if inside.any() and not inside.all():
        deep = ndimage.distance_transform_edt(inside)
        away = ndimage.distance_transform_edt(~inside)
        labels[(deep > band) & (cover > _SURE)] = Label.OBJECT
        middle = inside & (deep >= ndimage.maximum_filter(deep, _LINE))
        labels[middle & (cover > _LIKELY)] = Label.OBJECT
        labels[(away > band) & (cover < 1 - _SURE)] = Label.BACKGROUND
    labels[known > 0], labels[known < 0] = Label.OBJECT, Label.BACKGROUND
    return labels


def feathered(codes: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Soften the outline of a mask along the colours of the photo.

    Parameters
    ----------
    codes : (H, W, 3) uint8 ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W) float32 ndarray
    """
    guide = codes.astype(np.float32) / 255
    slope, offset = affine_fit(
        guide, mask[..., None].astype(np.float32), np.ones_like(mask), _EPSILON
    )
    soft = np.einsum("hwgc,hwg->hwc", slope, guide)[..., 0] + offset[..., 0]
    rim = ndimage.binary_dilation(mask, iterations=2) & ~ndimage.binary_erosion(mask, iterations=2)
    return np.where(rim, np.clip(soft, 0, 1), mask).astype(np.float32)
