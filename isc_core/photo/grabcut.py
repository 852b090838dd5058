"""Segmentation of an object inside a box drawn around it.

Problem: a photo whose background is not black has no mask; everything outside the box is
background, inside it is unknown.

Equation: GrabCut minimises, over the labels a of all pixels, E(a) = sum_p D(a_p, z_p) + sum_pq
V(a_p, a_q, z_p, z_q), where D is the negative log-likelihood of the colour z_p under a Gaussian
mixture of the object or of the background and V a contrast-weighted cost of the border; minimum
cuts and fits of the mixtures alternate.

Citation: C. Rother, V. Kolmogorov, A. Blake, "GrabCut", ACM Transactions on Graphics 23 (2004),
doi:10.1145/1015706.1015720; OpenCV's solver.

Limits: only colours count, so an object of the background's colour is segmented badly: check the
mask. Large boxes are solved at one megapixel and the border is interpolated.
"""

import os
from enum import IntEnum
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..imaging.srgb import linear_to_srgb
from ..io.atomic import new_file, require_writable_file
from ..io.decoders import MIN_SIDE
from ..io.limits import USUAL, Limits
from ..io.png import encode_png
from .masks import check_mask, tidy_mask
from .reading import read_linear

SOLVED_PIXELS = 1_000_000
_SEED = 0

Box = tuple[int, int, int, int]


def grabcut(image: np.ndarray, box: Box, iterations: int = 5) -> np.ndarray:
    """Segment the object within a box.

    The result is deterministic.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        RGB; uint8 codes or float linear light in [0, 1].
    box : tuple of int
        (x, y, width, height) in pixels from the top left.
    iterations : int

    Returns
    -------
    (H, W) bool ndarray
        False outside the box; holes filled, specks dropped.

    Raises
    ------
    InputError
        If the box lies outside the image, is thinner than 8 pixels, leaves no background, or holds
        no object.
    """
    height, width = image.shape[:2]
    check_box(box, width, height)
    x, y, w, h = box
    left, top, right, bottom = (
        max(x - w // 2, 0),
        max(y - h // 2, 0),
        min(x + w + w // 2, width),
        min(y + h + h // 2, height),
    )
    crop = image[top:bottom, left:right]
    coded = (
        crop
        if crop.dtype == np.uint8
        else np.rint(255 * np.clip(linear_to_srgb(crop), 0, 1)).astype(np.uint8)
    )
    cover = _solve(coded, (x - left, y - top, w, h), iterations)
    mask = np.zeros((height, width), bool)
    inside = cover[y - top : y - top + h, x - left : x - left + w] > 0.5
    mask[y : y + h, x : x + w] = tidy_mask(inside)
    check_mask(mask, f"--box {x},{y},{w},{h}: the mask that GrabCut finds")
    return mask


def check_box(box: Box, width: int, height: int) -> None:
    """Raise `InputError` for a box that is thin, leaves the image, or covers all of it.

    Parameters
    ----------
    box : tuple of int
        (x, y, width, height).
    width, height : int
        Of the image.
    """
    x, y, w, h = box
    name = f"--box {x},{y},{w},{h}"
    if w < MIN_SIDE or h < MIN_SIDE:
        raise InputError(
            f"{name}: the box x,y,width,height needs sides of at least {MIN_SIDE} pixels: draw it "
            "around the object"
        )
    if x < 0 or y < 0 or x + w > width or y + h > height:
        raise InputError(
            f"{name}: extends beyond the image of {width} x {height} pixels: keep it inside"
        )
    if (x, y, w, h) == (0, 0, width, height):
        raise InputError(
            f"{name}: covers the whole image: leave some background around the box to learn its "
            "colours from"
        )


def _solve(coded: np.ndarray, box: Box, iterations: int) -> np.ndarray:
    """Object coverage (H, W) float32 of an (H, W, 3) uint8 RGB image; solved at no more than a
    megapixel.
    """
    import cv2  # takes a while, and most photos have a mask

    height, width = coded.shape[:2]
    factor = min(1.0, float(np.sqrt(SOLVED_PIXELS / (height * width))))
    size = (max(round(width * factor), 1), max(round(height * factor), 1))
    small = np.ascontiguousarray(cv2.resize(coded, size, interpolation=cv2.INTER_AREA)[..., ::-1])
    x, y, w, h = (round(n * factor) for n in box)
    labels = np.full(small.shape[:2], cv2.GC_BGD, np.uint8)
    labels[y : y + h, x : x + w] = cv2.GC_PR_FGD
    if labels.all():
        raise InputError(
            "--box: leaves too little background to learn its colours from: draw it closer to the "
            "object"
        )
    cv2.setRNGSeed(_SEED)
    cv2.grabCut(
        small, labels, None, np.zeros((1, 65)), np.zeros((1, 65)), iterations, cv2.GC_INIT_WITH_MASK
    )
    probability = ((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)).astype(np.float32)
    return cv2.resize(probability, (width, height), interpolation=cv2.INTER_LINEAR)


class Label(IntEnum):
    """What is known of a pixel, in OpenCV's numbers."""

    BACKGROUND = 0
    OBJECT = 1
    PROBABLY_BACKGROUND = 2
    PROBABLY_OBJECT = 3


def segmented(coded: np.ndarray, labels: np.ndarray, iterations: int) -> np.ndarray:
    """Segment an image of which some pixels are known.

    Parameters
    ----------
    coded : (H, W, 3) uint8 ndarray
        RGB.
    labels : (H, W) uint8 ndarray
        Of `Label`; some of the object and some of the background.
    iterations : int

    Returns
    -------
    (H, W) bool ndarray
    """
    import cv2

    cv2.setRNGSeed(_SEED)
    found = cv2.grabCut(
        np.ascontiguousarray(coded[..., ::-1]),
        labels.copy(),
        None,
        np.zeros((1, 65)),
        np.zeros((1, 65)),
        iterations,
        cv2.GC_INIT_WITH_MASK,
    )[0]
    return (found == Label.OBJECT) | (found == Label.PROBABLY_OBJECT)


def write_mask(path: str | Path, mask: np.ndarray) -> None:
    """Write a mask as an 8-bit grey PNG, 255 inside, completely or not at all.

    Parameters
    ----------
    path : str or Path
    mask : (H, W) bool ndarray, or float cover in [0, 1]

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    _require_png(path)
    with new_file(path) as partial:
        partial.write_bytes(encoded_mask(mask))


def encoded_mask(mask: np.ndarray) -> bytes:
    """Return a mask as the bytes of a PNG, see `write_mask`.

    Parameters
    ----------
    mask : (H, W) bool ndarray, or float cover in [0, 1]

    Returns
    -------
    bytes
    """
    return encode_png(np.rint(255 * mask.astype(np.float32)).astype(np.uint8), compression=1)


def check_mask_path(photo_path: str | Path, out_path: str | Path) -> None:
    """Check, before the work, that a mask can be written.

    Parameters
    ----------
    photo_path, out_path : str or Path
        The photo, and the PNG of its mask.

    Raises
    ------
    InputError
        If it cannot, or would replace the photo.
    """
    _require_png(out_path)
    if (
        os.path.exists(out_path)
        and os.path.exists(photo_path)
        and os.path.samefile(photo_path, out_path)
    ):
        raise InputError(f"{out_path} is the photo itself: choose another file for its mask")
    require_writable_file(out_path)


def _require_png(path: str | Path) -> None:
    if Path(path).suffix.lower() != ".png":
        raise InputError(f"{path}: a mask is written as PNG: use a name that ends in .png")


def cut_out(
    photo_path: str | Path,
    box: Box,
    out_path: str | Path,
    transfer: str = "auto",
    limits: Limits = USUAL,
) -> np.ndarray:
    """Segment the object within a box of a photo and write its mask.

    Parameters
    ----------
    photo_path : str or Path
    box : tuple of int
        (x, y, width, height) in pixels of the upright photo.
    out_path : str or Path
        A PNG.
    transfer : {"auto", "srgb", "linear"}
    limits : Limits

    Returns
    -------
    (H, W) bool ndarray

    Raises
    ------
    InputError
        If the photo cannot be read, the box does not fit, nothing is found, or the mask cannot be
        written or would replace the photo.
    """
    check_mask_path(photo_path, out_path)
    image = read_linear(photo_path, transfer, limits)
    white = float(np.percentile(image, 99.9)) or float(image.max())
    if white == 0:
        raise InputError(
            f"{photo_path}: the image is black: there is nothing to segment; use another photo"
        )
    mask = grabcut(image / white, box)
    write_mask(out_path, mask)
    return mask
