"""Checks of the arrays of every separation."""

import numpy as np

from ...errors import InputError
from ...imaging.channels import largest, smallest

# Channels that differ by less than this share of the brightest value are equal: rounding of 16-bit
# codes is 1.5e-5. Highlights of renderings have no such codes and outshine all colour: they count
# as this many times the median only.
_GREY = 1e-4
_BRIGHTEST = 256.0


def check_arrays(image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None) -> None:
    """Raise `InputError` for arrays that cannot be separated.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Must be finite and not negative in the mask.
    mask : (H, W) bool ndarray
        Must not be empty.
    clipped : (H, W) bool ndarray or None
    """
    if image.ndim != 3 or image.shape[2] != 3:
        raise InputError(
            f"separation needs a colour image of shape (H, W, 3), not {image.shape}: convert it to "
            "RGB"
        )
    for name, array in (("mask", mask), ("clipped map", clipped)):
        if array is not None and (array.shape != image.shape[:2] or array.dtype != bool):
            raise InputError(
                f"the {name} must be boolean and {image.shape[:2]} like the image, not "
                f"{array.dtype} {array.shape}"
            )
    if not mask.any():
        raise InputError("the mask is empty: mark at least the object's pixels")
    inside = image[mask]
    if not np.isfinite(inside).all() or inside.min() < 0:
        raise InputError(
            "the image has negative or non-finite values inside the mask: repair or mask out those "
            "pixels"
        )


def has_colour(image: np.ndarray, mask: np.ndarray) -> bool:
    """Return whether any pixel of the mask has channels that differ by more than rounding.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
        Not empty.

    Returns
    -------
    bool
    """
    inside = image[mask]
    high = largest(inside)
    lit = high[high > 0]
    if not lit.size:
        return False
    brightest = min(float(lit.max()), _BRIGHTEST * float(np.median(lit)))
    return bool((high - smallest(inside)).max() > _GREY * brightest)


def require_colour(image: np.ndarray, mask: np.ndarray, method: str) -> None:
    """Require that some pixel of the mask has colour, see `has_colour`.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
        Not empty.
    method : str
        Name of the method, for the error message.

    Raises
    ------
    InputError
        If no pixel has colour.
    """
    if not has_colour(image, mask):
        raise InputError(
            f"the photo has no colour, which {method} needs to find highlights: use --method isc, "
            "or a colour photo"
        )
