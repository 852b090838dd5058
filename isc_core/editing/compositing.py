"""Transferring an edit to the photo at its full size.

Problem: the maps may be smaller than the photo, but the edited picture should keep the photo's
detail; pixels outside the object must not change.

Equation: the transferred quantity is the CHANGE, e = image' - image. Around each pixel k of the
maps it is modelled as an affine function of the photo's colour I, e ~ A_k^T I + b_k (see
`imaging.guided_filter`). Where the window's colours are uninformative, A falls back to the change
as a factor of each channel, mean_k e / mean_k I, at most 1, so that texture finer than the maps
gets the contrast of its new light. A and b, which are smooth, are upsampled and applied to the full
photo; the remainder of e is upsampled directly. So a removed highlight or a changed reflectance
ends at the photo's own edges. At the photo's own size e is added directly. Where an alpha channel
has a soft rim (hair, fur), the pixels that are covered by less than half, and so not in the mask,
change by A and b of the nearest pixel of the object: their colours are the object's.

Citation: K. He, J. Sun, X. Tang, "Guided image filtering", TPAMI 35(6), 2013,
doi:10.1109/TPAMI.2012.213; upsampling the coefficients: K. He, J. Sun, "Fast guided filter" (2015),
arXiv:1505.00996.

Limits: detail that the maps do not resolve changes only with its colour. Where the photo is
clipped, so is the edit.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..errors import InputError
from ..imaging.area_resize import reduced_count
from ..imaging.bounding_box import FramePart, mask_box, mask_slices
from ..imaging.guided_filter import affine_fit, window_means
from ..imaging.luminance import white_of
from ..photo import Photo
from ..photo.soft_rim import soft_rim
from ..scene.part_of_result import ResultPart
from .edited import Edited

_EPSILON = 1e-3  # of the white's square: contrasts below a thirtieth of the white are unreliable
_CHUNK = 1_000_000  # pixels at a time
_BOX_TOLERANCE = 3.0  # pixels of the maps: tolerance between the two boxes
_BORDER = 5  # pixels of the maps around the object: beyond the tolerance and interpolation


@dataclass(frozen=True, eq=False)
class EditedPart:
    """The part of a photo with its object, after an edit.

    Attributes
    ----------
    photo : Photo
        The part before the edit.
    image : (h, w, 3) float32 ndarray
        Linear, not negative.
    changed : (h, w) bool ndarray
        Where it differs from the photo; never outside the mask and its soft rim.
    place : FramePart
        The place of the part in the photo.
    """

    photo: Photo
    image: np.ndarray
    changed: np.ndarray
    place: FramePart


def composite(stored: ResultPart, edit: Edited, photo: Photo) -> EditedPart:
    """Apply an edit to the photo at full size.

    Parameters
    ----------
    stored : ResultPart
    edit : Edited
        Of this part.
    photo : Photo
        The photo that the result was made of, at full size, with the same mask.

    Returns
    -------
    EditedPart

    Raises
    ------
    InputError
        If photo, mask and result do not match.
    """
    d, part = stored.result, stored.part
    scale = scale_of(stored, photo)
    change = np.where(d.mask[..., None], edit.image - d.image, 0).astype(np.float32)
    rim = _soft_rim_outside(photo)
    covered = photo.mask | rim
    place = FramePart.around(covered, 0)
    near, direct = photo.cut(place), scale == 1 and part.shape == photo.mask.shape
    indirect = place.cut(rim if direct else covered)
    full = enlarged_change(stored, change, replace(near, mask=indirect), place, scale)
    if direct:
        full += place.cut(part.placed(change))
    changed = place.cut(covered) & (full != 0).any(-1)
    image = near.image.copy()
    image[changed] = np.maximum(image[changed] + full[changed], 0)
    return EditedPart(near, image, changed, place)


def _soft_rim_outside(photo: Photo) -> np.ndarray:
    """Where (H, W) a soft alpha channel covers less than half of a pixel."""
    cover = photo.cover
    if cover is not None and photo.original.mask_from == "alpha":
        soft = soft_rim(cover, photo.mask, own=True)
        if soft is not None:
            return np.asarray(soft & (cover > 0) & ~photo.mask)
    return np.zeros_like(photo.mask)


def scale_of(stored: ResultPart, photo: Photo) -> float:
    """Return the size of the maps over that of the photo.

    Parameters
    ----------
    stored : ResultPart
    photo : Photo

    Returns
    -------
    float

    Raises
    ------
    InputError
        If the photo or its mask is not that of the result.
    """
    d, part = stored.result, stored.part
    recorded = d.provenance.input.get("scale")
    size = d.provenance.input.get("size")
    if not isinstance(recorded, int | float) or not 0 < recorded <= 1 or not isinstance(size, list):
        raise InputError(
            "the result does not record the scale of its maps: decompose the photo again"
        )
    height, width = photo.mask.shape
    expected = tuple(reduced_count(count, recorded) for count in (height, width))
    if size != [width, height] or expected != part.shape:
        raise InputError(
            f"the result was made from a photo of {' x '.join(map(str, size))} pixels, not of "
            f"{width} x {height}: give the same photo"
        )
    box = np.add(mask_box(d.mask), (*part.corner, 0, 0))
    boxes = np.array(mask_box(photo.mask)) * recorded, box
    if np.abs(boxes[0] - boxes[1]).max() > _BOX_TOLERANCE:
        raise InputError(
            "the photo's mask differs from the one of the result: give the same mask with --mask"
        )
    return float(recorded)


def enlarged_change(
    stored: ResultPart, change: np.ndarray, photo: Photo, place: FramePart, scale: float
) -> np.ndarray:
    """Upsample the change of the maps' image, guided by the colours of the full photo.

    Parameters
    ----------
    stored : ResultPart
    change : (h, w, 3) ndarray
        Of its image.
    photo : Photo
        A part of the photo; its mask says where the change is wanted.
    place : FramePart
        The place of that part.
    scale : float
        Size of the maps over that of the photo.

    Returns
    -------
    (H, W, 3) float32 ndarray
        0 outside that mask.
    """
    result, d = np.zeros(photo.image.shape, np.float32), stored.result
    if not (change.any() and photo.mask.any()):
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
    planes, first = _continued(planes.astype(np.float32), stored)
    rows, columns = np.nonzero(photo.mask)
    for start in range(0, len(rows), _CHUNK):
        at = rows[start : start + _CHUNK], columns[start : start + _CHUNK]
        places = [
            (index + along.start + 0.5) * scale - 0.5 - start
            for index, along, start in zip(at, (place.rows, place.columns), first, strict=True)
        ]
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


def _continued(planes: np.ndarray, stored: ResultPart) -> tuple[np.ndarray, tuple[int, int]]:
    """`planes` (h, w, C) of the part continued beyond the object by their nearest values, in the
    frame or near the object; and the row and the column in the frame where they begin.
    """
    mask, part = stored.result.mask, stored.part
    if part.is_whole:
        near = part
    else:
        mask = part.placed(mask)
        near = FramePart(*mask_slices(mask, _BORDER), part.shape)
        mask = near.cut(mask)
    nearest = ndimage.distance_transform_edt(~mask, return_distances=False, return_indices=True)
    moved = (near.rows.start - part.rows.start, near.columns.start - part.columns.start)
    at = tuple(index + by for index, by in zip(nearest, moved, strict=True))
    return planes[at], (near.rows.start, near.columns.start)
