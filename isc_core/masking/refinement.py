"""The outline of a mask at the photo's own pixels.

Problem: the network sees at most 128 pixels; its outline is off by up to one of them.

Equation: the network has learned from composites, and photos by people show larger objects of more
parts. Its log odds of the object are therefore raised, as for a larger prior. Pixels of which it is
certain, and which lie away from the outline, are fixed. So is the medial axis of the object, so
that thin parts are kept. GrabCut labels all other pixels by colour and contrast (`photo.grabcut`).
The coverage a of the rim is the guided filter of the labels with the photo I as its guide: a = A I
+ b in windows of a few pixels.

Citation: C. Rother et al. 2004, doi:10.1145/1015706.1015720; K. He, J. Sun, X. Tang 2013,
doi:10.1109/TPAMI.2012.213 (section 4, feathering); another prior: M. Saerens, P. Latinne, C.
Decaestecker 2002, doi:10.1162/089976602753284446.

Limits: solved at a length of at most `SIDE` pixels; a large photo's rim is upsampled from there.
"""

import numpy as np

from ..filters.distance import distance_to
from ..filters.extrema import window_maximum
from ..filters.morphology import dilated, eroded
from ..imaging.guided_filter import affine_fit
from ..imaging.resampling import resampled
from ..imaging.srgb import srgb_codes
from ..photo.grabcut import Label, segmented
from ..photo.masks import tidy_mask

SIDE = 384  # pixels of the longer side
_CERTAIN = 0.97  # probability from which a pixel away from the outline is fixed
_AXIS_CERTAIN = 0.8  # the same for the medial axis of the object
_AXIS_WINDOW = 5  # pixels: the medial axis has maxima of the distance to the outline in it
_BAND = 0.03  # of the longer side: largest error of the network's outline
_ITERATIONS = 1
_EPSILON = 1e-3  # of the guided filter, for sRGB codes in [0, 1]


def refined(
    light: np.ndarray, cover: np.ndarray, known: np.ndarray, shift: float = 0.0
) -> np.ndarray:
    """Refine the network's mask.

    Parameters
    ----------
    light : (H, W, 3) float32 ndarray
        Linear; the crop of the photo that contains the object.
    cover : (H, W) float32 ndarray
        The network's probabilities.
    known : (H, W) int8 ndarray
        1 where the user has marked the object, -1 the background, else 0.
    shift : float
        What the log odds of the object are raised by.

    Returns
    -------
    (H, W) float32 ndarray
        Coverage, 0 to 1.
    """
    height, width = cover.shape
    factor = min(1.0, SIDE / max(width, height))
    small = max(round(height * factor), 1), max(round(width * factor), 1)
    codes = srgb_codes(resampled(light, small))
    likelier = with_larger_prior(resampled(cover, small).clip(0, 1), shift)
    fine = segmented_cover(codes, likelier, _nearest(known, small))
    return resampled(fine, (height, width))


def with_larger_prior(cover: np.ndarray, shift: float) -> np.ndarray:
    """Raise the log odds of the object.

    Parameters
    ----------
    cover : (H, W) float32 ndarray
        Probabilities, 0 to 1.
    shift : float

    Returns
    -------
    (H, W) float32 ndarray
        Probabilities.
    """
    raised = np.float32(np.exp(shift)) * cover
    return np.asarray(raised / (raised + 1 - cover))


def _nearest(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Resample (H, W) values to another shape, by nearest neighbours."""
    height, width = shape
    rows = (np.arange(height) + 0.5) * (values.shape[0] / height)
    columns = (np.arange(width) + 0.5) * (values.shape[1] / width)
    return values[rows.astype(int)[:, None], columns.astype(int)]


def segmented_cover(codes: np.ndarray, cover: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Segment the pixels near the outline, and estimate the coverage of the rim.

    Parameters
    ----------
    codes : (H, W, 3) uint8 ndarray
    cover : (H, W) float32 ndarray
    known : (H, W) int8 ndarray
        See `refined`.

    Returns
    -------
    (H, W) float32 ndarray
        0 if no pixel is certain to be of the object.
    """
    labels = trimap(cover, known)
    if not (labels == Label.OBJECT).any():
        return np.zeros_like(cover)
    if not (labels == Label.BACKGROUND).any():
        return cover
    mask = tidy_mask(segmented(codes, labels, _ITERATIONS))
    return feathered(codes, mask)


def trimap(cover: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return which pixels are fixed, and the initial labels of the others.

    Parameters
    ----------
    cover : (H, W) float32 ndarray
    known : (H, W) int8 ndarray
        See `refined`.

    Returns
    -------
    (H, W) uint8 ndarray
        Values of `Label`.
    """
    band = _BAND * max(cover.shape)
    inside = cover > 0.5
    labels = np.where(inside, Label.PROBABLY_OBJECT, Label.PROBABLY_BACKGROUND).astype(np.uint8)
    if inside.any() and not inside.all():
        depth, distance = distance_to(~inside), distance_to(inside)
        labels[(depth > band) & (cover > _CERTAIN)] = Label.OBJECT
        axis = inside & (depth >= window_maximum(depth, _AXIS_WINDOW))
        labels[axis & (cover > _AXIS_CERTAIN)] = Label.OBJECT
        labels[(distance > band) & (cover < 1 - _CERTAIN)] = Label.BACKGROUND
    labels[known > 0], labels[known < 0] = Label.OBJECT, Label.BACKGROUND
    return labels


def feathered(codes: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Estimate the coverage of a mask's rim from the colours of the photo.

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
    rim = dilated(mask, 2) & ~eroded(mask, 2)
    return np.where(rim, np.clip(soft, 0, 1), mask).astype(np.float32)
