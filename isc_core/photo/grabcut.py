"""Segmentation of an object inside a box drawn around it.

Problem: a photo whose background is not black has no mask; everything outside the box is
background, inside it is unknown.

Equation: GrabCut minimises, over the labels a of all pixels, E(a) = sum_p D(a_p, z_p) + sum_pq
V(a_p, a_q, z_p, z_q), where D is the negative log-likelihood of the colour z_p under a Gaussian
mixture of the object or of the background and V a contrast-weighted cost of the border; minimum
cuts and fits of the mixtures alternate.

Citation: C. Rother, V. Kolmogorov, A. Blake, "GrabCut", ACM Transactions on Graphics 23 (2004),
doi:10.1145/1015706.1015720; the cut in a band: H. Lombaert et al., "A multilevel banded graph cuts
method for fast image segmentation", ICCV 2005, doi:10.1109/ICCV.2005.13.

Limits: only colours are compared, so an object of the background's colour is segmented badly: check
the mask. Large boxes are solved at 65,000 pixels, their outline at half a megapixel, and the border
is interpolated; parts thinner than two coarse pixels may be lost.
"""

import os
from enum import IntEnum
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..filters.morphology import dilated, eroded
from ..imaging.minimum_cut import STEPS, minimum_cut, shifted
from ..imaging.resampling import resampled
from ..imaging.srgb import share_codes, srgb_codes
from ..io.atomic import new_file, require_writable_file
from ..io.decoders import MIN_SIDE
from ..io.limits import DEFAULT_LIMITS, Limits
from ..io.png import encode_png
from .colour_mixture import ColourMixture, split_colours
from .masks import check_mask, tidy_mask
from .reading import read_linear

COARSE_PIXELS, SOLVED_PIXELS = 1 << 16, 1 << 19
_BAND = 6  # pixels to both sides of the coarse outline, two coarse ones
_SMOOTHNESS = 50.0  # cost of neighbours of one colour that differ in label

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
        False outside the box; holes are filled, small parts removed.

    Raises
    ------
    InputError
        If the box lies outside the image, is thinner than 8 pixels, leaves no background, or
        contains no object.
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
    coded = crop if crop.dtype == np.uint8 else srgb_codes(crop)
    cover = _solve(coded, (x - left, y - top, w, h), iterations)
    mask = np.zeros((height, width), bool)
    inside = cover[y - top : y - top + h, x - left : x - left + w] > 0.5
    mask[y : y + h, x : x + w] = tidy_mask(inside)
    check_mask(mask, f"--box {x},{y},{w},{h}: the mask that GrabCut finds")
    return mask


def check_box(box: Box, width: int, height: int) -> None:
    """Raise `InputError` for a box that is thin, extends beyond the image, or covers all of it.

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
    """Object coverage (H, W) float32 of an (H, W, 3) uint8 RGB image, solved coarsely and then
    refined at the outline.
    """
    height, width = coded.shape[:2]
    small, part = _reduced(coded, box, COARSE_PIXELS)
    labels = np.full(small.shape[:2], Label.BACKGROUND, np.uint8)
    labels[part] = Label.PROBABLY_OBJECT
    if labels.all():
        raise InputError(
            "--box: leaves too little background to learn its colours from: draw it closer to the "
            "object"
        )
    found = segmented(small, labels, iterations)
    fine, part = _reduced(coded, box, SOLVED_PIXELS)
    if fine.shape != small.shape and found.any():
        cover = resampled(found.astype(np.float32), (fine.shape[0], fine.shape[1])) > 0.5
        found = segmented(fine, _band(cover, part), 1)
    return resampled(found.astype(np.float32), (height, width))


def _reduced(coded: np.ndarray, box: Box, most: int) -> tuple[np.ndarray, tuple[slice, slice]]:
    """The codes (h, w, 3) uint8 downscaled to at most so many pixels, and the box in them."""
    height, width = coded.shape[:2]
    factor = min(1.0, float(np.sqrt(most / (height * width))))
    size = (max(round(width * factor), 1), max(round(height * factor), 1))
    x, y, w, h = (round(n * factor) for n in box)
    small = np.rint(resampled(coded.astype(np.float32), size[::-1])).astype(np.uint8)
    return small, (slice(y, y + h), slice(x, x + w))


def _band(found: np.ndarray, part: tuple[slice, slice]) -> np.ndarray:
    """Labels that are uncertain near the outline of a mask, inside the box."""
    near = dilated(found, _BAND)
    deep = eroded(found, _BAND, beyond=True)
    labels = np.where(found, Label.PROBABLY_OBJECT, Label.PROBABLY_BACKGROUND).astype(np.uint8)
    labels[deep] = Label.OBJECT
    outside = np.ones(found.shape, bool)
    outside[part] = False
    labels[~near | outside] = Label.BACKGROUND
    return labels


class Label(IntEnum):
    """The prior knowledge of a pixel."""

    BACKGROUND = 0
    OBJECT = 1
    PROBABLY_BACKGROUND = 2
    PROBABLY_OBJECT = 3


def segmented(coded: np.ndarray, labels: np.ndarray, iterations: int) -> np.ndarray:
    """Segment an image with some known pixels.

    Parameters
    ----------
    coded : (H, W, 3) uint8 ndarray
        RGB.
    labels : (H, W) uint8 ndarray
        Values of `Label`, of both the object and the background.
    iterations : int

    Returns
    -------
    (H, W) bool ndarray
    """
    codes = coded.astype(float)
    inside = (labels == Label.OBJECT) | (labels == Label.PROBABLY_OBJECT)
    free = (labels == Label.PROBABLY_OBJECT) | (labels == Label.PROBABLY_BACKGROUND)
    assignments = np.zeros(inside.shape, int)
    for part in (inside, ~inside):
        assignments[part] = split_colours(codes[part])
    links = _links(codes)
    for _ in range(iterations):
        mixtures = [
            ColourMixture.fitted(codes[part], assignments[part]) for part in (~inside, inside)
        ]
        inside = _cut(codes, mixtures, links, free, inside)
        if inside.all() or not inside.any():
            break
        for mixture, part in zip(mixtures, (~inside, inside), strict=True):
            assignments[part] = np.argmin(mixture.costs(codes[part]), axis=0)
    return inside


def _links(codes: np.ndarray) -> list[np.ndarray]:
    """Costs of different labels of neighbours: low where colours differ."""
    squares = []
    for step in STEPS:
        here, there = shifted(codes.shape, step)
        squares.append(((codes[here] - codes[there]) ** 2).sum(axis=2))
    mean = sum(float(one.sum()) for one in squares) / max(sum(one.size for one in squares), 1)
    sharpness = 1 / (2 * mean) if mean > 0 else 0.0
    return [
        _SMOOTHNESS / np.hypot(*step) * np.exp(-sharpness * one)
        for step, one in zip(STEPS, squares, strict=True)
    ]


def _cut(
    codes: np.ndarray,
    mixtures: list[ColourMixture],
    links: list[np.ndarray],
    free: np.ndarray,
    inside: np.ndarray,
) -> np.ndarray:
    """Label the free pixels by the mixtures of the background and of the object."""
    difference = np.zeros(free.shape)
    background, foreground = (mixture.cost(codes[free]) for mixture in mixtures)
    difference[free] = background - foreground
    return minimum_cut(difference, links, free, inside)


def write_mask(path: str | Path, mask: np.ndarray) -> None:
    """Write a mask as an 8-bit grey PNG, 255 inside, completely or not at all.

    Parameters
    ----------
    path : str or Path
    mask : (H, W) bool ndarray, or float coverage in [0, 1]

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
    mask : (H, W) bool ndarray, or float coverage in [0, 1]

    Returns
    -------
    bytes
    """
    return encode_png(share_codes(mask), compression=1)


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
    limits: Limits = DEFAULT_LIMITS,
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
