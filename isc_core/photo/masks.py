"""Finding the object's mask in a photo, and checking it."""

from collections.abc import Iterator

import numpy as np

from ..errors import InputError
from ..filters.components import labelled
from ..imaging.bounding_box import mask_box
from ..imaging.channels import largest
from ..imaging.row_blocks import row_blocks
from ..imaging.srgb import srgb_to_linear
from ..io.decoders import MIN_SIDE, Raster
from ..io.decoders.raster import as_rgb
from .found_mask import FoundMask, MaskFinder
from .names import WholeFrame

MIN_MASK_PIXELS = 64
BLACK = 2.0 / 255.0
_MOST_WHITE = 10.0  # times the median light of an object on pure black
_LEFT_OUT = 1e-3  # of the photo: an alpha channel that leaves out less is no mask but stray pixels
_CHUNK = 1 << 16  # pixels compared at a time
_HARD = 0.02  # of the largest value: lossy files differ from 0 and 1 by as much


def check_mask(mask: np.ndarray, what: str) -> None:
    """Raise `InputError` for a mask that is empty, has fewer than 64 pixels or is thinner than 8.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    what : str
        Prefix of the error message.
    """
    if problem := mask_problem(mask, what):
        raise InputError(problem)


def mask_problem(mask: np.ndarray, what: str) -> str:
    """Say what is wrong with a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    what : str
        Prefix of the message.

    Returns
    -------
    str
        The message of `check_mask`; "" if the mask can be used.
    """
    count = int(mask.sum())
    if count == 0:
        return f"{what} is empty: mark the object in white on black"
    if count < MIN_MASK_PIXELS:
        return (
            f"{what} has only {count} pixels: at least {MIN_MASK_PIXELS} are required; use a "
            "larger photo or mask"
        )
    width, height = mask_box(mask)[2:]
    if min(width, height) < MIN_SIDE:
        return (
            f"{what} is only {width} x {height} pixels: each side needs at least {MIN_SIDE}; "
            "use a larger photo or mask"
        )
    return ""


def tidy_mask(mask: np.ndarray) -> np.ndarray:
    """Fill the holes of a mask and drop parts smaller than 1 % of the largest part.

    Parameters
    ----------
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W) bool ndarray
    """
    labels, _ = labelled(~mask)
    outside = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    filled = mask | ~np.isin(labels, outside)
    labels, _ = labelled(filled, corners=True)
    areas = np.bincount(labels.ravel())
    areas[0] = 0
    return (areas >= max(0.01 * areas.max(), 1))[labels]


def find_mask(
    name: str,
    raster: Raster,
    linear: np.ndarray,
    whole_frame: WholeFrame,
    finder: MaskFinder | None = None,
) -> tuple[np.ndarray | FoundMask, str]:
    """Find the object's mask in the photo itself, and name its source.

    Parameters
    ----------
    name : str
        The photo; prefix of the error message.
    raster : Raster
        Of the photo.
    linear : (H, W, 1 or 3) ndarray
        Its linear light.
    whole_frame : WholeFrame
        Whether all pixels are used.
    finder : MaskFinder, optional
        Finds the object where there is no alpha channel and no black border.

    Returns
    -------
    mask : (H, W) bool ndarray, or FoundMask
    source : str
        "alpha", "black border", "automatic" or "whole frame".

    Raises
    ------
    InputError
        If no mask is found.
    """
    always_whole = whole_frame is WholeFrame.ALWAYS
    looked_for = finder is not None and finder.always
    if not (looked_for or always_whole):
        opaque = opaque_part(raster)
        if opaque is not None:
            return opaque, "alpha"
    dark = float(srgb_to_linear(BLACK))
    border = _brightest(np.concatenate([linear[0], linear[-1], linear[:, 0], linear[:, -1]]))
    # Codes have a known white, so that behind a bright border their light is not needed.
    enough = raster.peak is not None and (border > dark).any()
    light = border if enough else _brightest(linear)
    if not (light > 0).any():
        raise InputError(
            f"{name}: the image is black: there is nothing to recover; use another photo"
        )
    if always_whole:
        return np.ones(linear.shape[:2], bool), "whole frame"
    white = 1.0 if raster.peak is not None else _white_of_floats(light, border)
    if finder is not None and finder.always:
        found = finder(name, normalised_to_white(linear, white))
        if found is not None:
            return found, "hints"
    if (border > white * dark).any():
        found = None if finder is None else finder(name, normalised_to_white(linear, white))
        if found is not None:
            return found, "automatic"
        if whole_frame is WholeFrame.WITHOUT_MASK:
            return np.ones(linear.shape[:2], bool), "whole frame"
        raise InputError(
            f"{name}: there is no mask, no transparency and no black border: "
            "make a mask with `isc mask PHOTO --box x,y,w,h -o MASK` and give it with --mask"
        )
    bright = light > white * dark
    if not bright.any():
        raise InputError(
            f"{name}: the image is almost black: there is nothing to recover; use another photo"
        )
    return tidy_mask(bright), "black border"


def opaque_part(raster: Raster) -> np.ndarray | None:
    """Return where the alpha channel is at least .5.

    Parameters
    ----------
    raster : Raster

    Returns
    -------
    (H, W) bool ndarray or None
        None without a channel that leaves something out.
    """
    if raster.transparency is None:
        return None
    opaque = raster.transparency >= 0.5
    return opaque if float((~opaque).mean()) >= _LEFT_OUT else None


def _brightest(values: np.ndarray) -> np.ndarray:
    """The largest channel of each pixel, 0 where that is not finite."""
    return finite_or_zero(largest(values))


def _white_of_floats(light: np.ndarray, border: np.ndarray) -> float:
    """White of a float file, which has no peak value: the 99th percentile of its light.

    Highlights of a render may be thousands of times brighter than all else. On pure black, where
    all light is the object's, they do not count as white: the rest would be taken for black.
    """
    light = light[light > 0]
    white = float(np.percentile(light, 99.0))
    return white if border.any() else min(white, _MOST_WHITE * float(np.median(light)))


def soft_cover(raster: Raster, mask: np.ndarray) -> np.ndarray | None:
    """Return the fractional coverage of pixels by the object, where an image has it.

    Parameters
    ----------
    raster : Raster
        A mask, or a photo with an alpha channel.
    mask : (H, W) bool ndarray
        The object in it.

    Returns
    -------
    (H, W) float32 ndarray or None
        0 to 1: the alpha channel if it leaves something out, else the values over that of most of
        the object. None where all are practically 0 or 1, or where most of the background is not 0.
    """
    alpha = None if opaque_part(raster) is None else raster.transparency
    values = largest(raster.values) if alpha is None else alpha
    full = 1.0 if alpha is not None else float(np.median(finite_or_zero(values[mask])))

    def shares() -> Iterator[np.ndarray]:
        for block in row_blocks(mask.shape, pixels=_CHUNK):
            part = finite_or_zero(values[block.rows]).astype(np.float32)
            yield np.clip(part / max(full, 1e-12), 0, 1)

    if not any(((part > _HARD) & (part < 1 - _HARD)).any() for part in shares()):
        return None
    cover = np.concatenate([*shares()])
    empty = np.count_nonzero((cover <= _HARD) & ~mask)
    return cover if 2 * empty >= mask.size - np.count_nonzero(mask) else None


def normalised_to_white(linear: np.ndarray, white: float) -> np.ndarray:
    """Return light in the form that a `MaskFinder` expects.

    Parameters
    ----------
    linear : (H, W, 1 or 3) ndarray
    white : float
        > 0.

    Returns
    -------
    (H, W, 3) float32 ndarray
        Finite, not negative, 1 is white.
    """
    light = as_rgb(linear if white == 1 else np.maximum(finite_or_zero(linear), 0) / white)
    return light.astype(np.float32, copy=False)


def mask_of(raster: Raster, name: str, photo: Raster) -> np.ndarray:
    """Return the mask in an image.

    Parameters
    ----------
    raster : Raster
        Of the image.
    name : str
        Prefix of the error message.
    photo : Raster
        The photo.

    Returns
    -------
    (H, W) bool ndarray
        Where the alpha channel is at least 0.5; without one that leaves something out, where the
        values are above half of the largest.

    Raises
    ------
    InputError
        If the sizes differ.
    """
    if raster.values.shape[:2] != photo.values.shape[:2]:
        (h, w), (mask_h, mask_w) = photo.values.shape[:2], raster.values.shape[:2]
        raise InputError(
            f"{name}: the mask is {mask_w} x {mask_h} pixels, the photo {w} x {h}: use a "
            "mask of the photo's size"
        )
    opaque = opaque_part(raster)
    if opaque is not None:
        return opaque
    values = _brightest(raster.values)
    # Half of the largest value, not of the format's maximum: masks of 0 and 1 are common.
    return values > 0.5 * max(float(values.max()), 0.0)


def finite_or_zero(values: np.ndarray) -> np.ndarray:
    """Replace values that are not finite by 0.

    Parameters
    ----------
    values : ndarray

    Returns
    -------
    ndarray
        Of the shape and dtype of `values`; integers unchanged.
    """
    if values.dtype.kind != "f":
        return values
    return np.where(np.isfinite(values), values, np.zeros(1, values.dtype))
