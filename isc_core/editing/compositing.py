"""Transferring an edit to the photo at its full size.

Problem: the maps may be smaller than the photo, but the edited picture should keep the photo's
detail; pixels outside the object must not change.

Equation: the transferred quantity is the CHANGE, e = image' - image. Around each pixel k of the
maps it is modelled as an affine function of the photo's colour I, e ~ A_k^T I + b_k (see
`imaging.guided_filter`). Where the window's colours are uninformative, A falls back to the change
as a factor of each channel, mean_k e / mean_k I, at most 1, so that texture finer than the maps
gets the contrast of its new light. A and b, which are smooth, are upsampled and applied to the full
photo; the remainder of e is upsampled directly. So a removed highlight or a changed reflectance
ends at the photo's own edges. At the photo's own size e is added directly.

Citation: K. He, J. Sun, X. Tang, "Guided image filtering", TPAMI 35(6), 2013,
doi:10.1109/TPAMI.2012.213; upsampling the coefficients: K. He, J. Sun, "Fast guided filter" (2015),
arXiv:1505.00996.

Limits: detail that the maps do not resolve changes only with its colour. Where the photo is
clipped, so is the edit.
"""

import numpy as np
from scipy import ndimage

from ..errors import InputError
from ..imaging.area_resize import reduced_count
from ..imaging.bounding_box import mask_box
from ..imaging.guided_filter import affine_fit, window_means
from ..imaging.luminance import white_of
from ..photo import Photo
from ..scene.decomposition import Decomposition
from .edited import Edited

_EPSILON = 1e-3  # of the white's square: contrasts below a thirtieth of the white are unreliable
_CHUNK = 1_000_000  # pixels at a time
_BOX_TOLERANCE = 3.0  # pixels of the maps: tolerance between the two boxes


def composite(d: Decomposition, edit: Edited, photo: Photo) -> tuple[np.ndarray, np.ndarray]:
    """Apply an edit to the photo at full size.

    Parameters
    ----------
    d : Decomposition
    edit : Edited
    photo : Photo
        The photo that the result was made of, at full size, with the same mask.

    Returns
    -------
    image : (H, W, 3) float32 ndarray
        Linear, not negative.
    changed : (H, W) bool ndarray
        Where it differs from the photo; never outside the mask.

    Raises
    ------
    InputError
        If photo, mask and result do not match.
    """
    scale = scale_of(d, photo)
    change = np.where(d.mask[..., None], edit.image - d.image, 0).astype(np.float32)
    full = (
        change
        if scale == 1 and change.shape == photo.image.shape
        else enlarged_change(d, change, photo, scale)
    )
    changed = photo.mask & (full != 0).any(-1)
    image = photo.image.copy()
    image[changed] = np.maximum(image[changed] + full[changed], 0)
    return image, changed


def scale_of(d: Decomposition, photo: Photo) -> float:
    """Return the size of the maps over that of the photo.

    Parameters
    ----------
    d : Decomposition
    photo : Photo

    Returns
    -------
    float

    Raises
    ------
    InputError
        If the photo or its mask is not that of the result.
    """
    recorded = d.provenance.input.get("scale")
    size = d.provenance.input.get("size")
    if not isinstance(recorded, int | float) or not 0 < recorded <= 1 or not isinstance(size, list):
        raise InputError(
            "the result does not record the scale of its maps: decompose the photo again"
        )
    height, width = photo.mask.shape
    expected = tuple(reduced_count(count, recorded) for count in (height, width))
    if size != [width, height] or expected != d.mask.shape:
        raise InputError(
            f"the result was made from a photo of {' x '.join(map(str, size))} pixels, not of "
            f"{width} x {height}: give the same photo"
        )
    boxes = np.array(mask_box(photo.mask)) * recorded, np.array(mask_box(d.mask))
    if np.abs(boxes[0] - boxes[1]).max() > _BOX_TOLERANCE:
        raise InputError(
            "the photo's mask differs from the one of the result: give the same mask with --mask"
        )
    return float(recorded)


def enlarged_change(d: Decomposition, change: np.ndarray, photo: Photo, scale: float) -> np.ndarray:
    """Upsample the change of the maps' image, guided by the colours of the full photo.

    Parameters
    ----------
    d : Decomposition
    change : (h, w, 3) ndarray
    photo : Photo
    scale : float
        Size of the maps over that of the photo.

    Returns
    -------
    (H, W, 3) float32 ndarray
        0 outside the photo's mask.
    """
    result = np.zeros(photo.image.shape, np.float32)
    if not change.any():
        return result
    epsilon = _EPSILON * white_of(d.image, d.mask) ** 2
    mean_image, mean_change = (
        window_means(values.astype(float), d.mask) for values in (d.image, change)
    )
    factor = np.clip(mean_change / np.maximum(mean_image, np.sqrt(epsilon)), -1, 1)
    slope, offset = affine_fit(
        d.image.astype(float),
        change.astype(float),
        d.mask,
        epsilon,
        factor[..., None, :] * np.eye(3),
    )
    rest = change - np.einsum("hwgc,hwg->hwc", slope, d.image) - offset
    planes = np.concatenate([slope.reshape(*d.mask.shape, 9), offset + rest], -1)
    nearest = ndimage.distance_transform_edt(~d.mask, return_distances=False, return_indices=True)
    planes = planes[tuple(nearest)].astype(np.float32)
    rows, columns = np.nonzero(photo.mask)
    for start in range(0, len(rows), _CHUNK):
        at = rows[start : start + _CHUNK], columns[start : start + _CHUNK]
        places = [(index + 0.5) * scale - 0.5 for index in at]
        found = np.stack(
            [
                ndimage.map_coordinates(planes[..., k], places, order=1, mode="nearest")
                for k in range(12)
            ],
            -1,
        )
        result[at] = (
            np.einsum("ngc,ng->nc", found[:, :9].reshape(-1, 3, 3), photo.image[at]) + found[:, 9:]
        )
    return result
