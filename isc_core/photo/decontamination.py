"""Foreground colours at the soft rim of an object, without the background.

Problem: a pixel of the outline shows object and background, I = a F + (1 - a) B for its coverage a.
If it is taken for the object, the background distorts shape and colours there.

Equation: with means over a window, f = mean(a^8 I) / mean(a^8) and b the same for 1 - a, so that
pure pixels have the largest weights, F = f + a (I - a f - (1 - a) b).

The coverage of a found mask is off by about a pixel, so that the outermost pixels keep some of the
background, or lose too much of it. Their F is limited, by channel, to the range of the adjacent
pixels further inside.

Citation: M. Forte, "Approximate fast foreground colour estimation", ICIP 2021,
doi:10.1109/ICIP42928.2021.9506164.

Limits: a single step, on a downscaled photo, with powers of a instead of a: colours that vary
within the window are averaged. A line of another colour along the outline, one pixel of the
downscaled photo wide, is lost. A shadow that is wider than that stays.
"""

import numpy as np

from ..filters.box import box_average
from ..filters.extrema import window_maximum, window_minimum
from ..filters.morphology import eroded
from ..imaging.bounding_box import mask_slices
from ..imaging.resampling import resampled

_SOLVED = 512  # pixels of the longer side on which means are taken
_LIMITED = 256  # the same for the limits of the outermost pixels: about that of found masks
_WINDOW = 9  # of these pixels
_POWER = 8
_LEAST = 1e-6


def estimate_foreground(
    image: np.ndarray, cover: np.ndarray, *, in_place: bool = False
) -> np.ndarray:
    """Replace the colours at the rim of an object by foreground colours.

    Parameters
    ----------
    image : (H, W, 3) float32 ndarray
        Linear.
    cover : (H, W) float32 ndarray
        0 to 1.
    in_place : bool, optional
        Whether to change `image` instead of a copy.

    Returns
    -------
    (H, W, 3) float32 ndarray
        The image, changed where the coverage is at least half, but below 1, and at the outermost
        pixels of those of at least half. The same array if no pixel is partly covered.
    """
    rim = _rim(cover)
    if not rim.any():
        return image
    result = image if in_place else image.copy()
    _unmix(result, cover, rim)
    _limit_outermost(result, cover >= 0.5)
    return result


def unmixed(image: np.ndarray, cover: np.ndarray) -> np.ndarray:
    """Take the background out of partly covered pixels, without limits on their colours.

    Parameters
    ----------
    image : (H, W, 3) float32 ndarray
    cover : (H, W) float32 ndarray
        As for `estimate_foreground`.

    Returns
    -------
    (H, W, 3) float32 ndarray
        The image, changed where the coverage is at least half, but below 1; the same array if there
        is no such pixel.
    """
    rim = _rim(cover)
    if not rim.any():
        return image
    result = image.copy()
    _unmix(result, cover, rim)
    return result


def _rim(cover: np.ndarray) -> np.ndarray:
    return np.asarray((cover >= 0.5) & (cover < 1))


def _unmix(image: np.ndarray, cover: np.ndarray, rim: np.ndarray) -> None:
    """Take the background out of the pixels of the rim, which is not empty, in place."""
    place = mask_slices(cover > 0)
    part, share = image[place], cover[place]
    size = _downscaled(share.shape, _SOLVED)
    small, a = resampled(part, size), resampled(share, size)[..., None]
    front, back = _means(small, a**_POWER), _means(small, (1 - a) ** _POWER)
    rows, columns = np.nonzero(rim[place])
    at = (rows * size[0]) // share.shape[0], (columns * size[1]) // share.shape[1]
    a, seen = share[rows, columns][:, None], part[rows, columns]
    colours = front[at] + a * (seen - a * front[at] - (1 - a) * back[at])
    part[rows, columns] = np.maximum(colours, 0)


def _downscaled(shape: tuple[int, ...], side: int) -> tuple[int, int]:
    """Height and width with a longer side of at most `side`."""
    factor = min(1.0, side / max(shape))
    return max(round(shape[0] * factor), 1), max(round(shape[1] * factor), 1)


def _limit_outermost(image: np.ndarray, mask: np.ndarray) -> None:
    """Limit the colours of a mask's outermost pixels to the range of adjacent inner ones, in place.

    The pixels are those of the downscaled object. The mask is not empty.
    """
    place = mask_slices(mask, 1)
    part, inside = image[place], mask[place]
    height, width = inside.shape
    size = _downscaled(inside.shape, _LIMITED)
    small, share = resampled(part, size), resampled(inside.astype(np.float32), size)
    inner = eroded(share >= 0.5, beyond=True)
    at = (np.arange(height) * size[0]) // height, (np.arange(width) * size[1]) // width
    rows, columns = np.nonzero(inside & ~inner[np.ix_(*at)])
    shown, near = inner[..., None], (at[0][rows], at[1][columns])
    least = window_minimum(np.where(shown, small, np.inf), 3)[near]
    most = window_maximum(np.where(shown, small, -np.inf), 3)[near]
    seen = part[rows, columns]
    part[rows, columns] = np.where(np.isinf(least), seen, np.clip(seen, least, most))


def _means(image: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Weighted means over windows."""
    total, share = (box_average(part, _WINDOW, mirrored=True) for part in (image * weight, weight))
    return np.asarray(total / np.maximum(share, _LEAST))
