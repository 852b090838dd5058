"""What every separation asks of its arrays."""

import numpy as np

from ...errors import InputError
from ...imaging.channels import largest, smallest

# Channels that differ by less than this share of the brightest value are equal: rounding of 16-bit
# codes is 1.5e-5.
_GREY = 1e-4


def check_arrays(image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None) -> None:
    """Raises `InputError` unless `image` is (H, W, 3), finite and >= 0 in a non-empty `mask` (H, W)
    bool, as is `clipped` or None.
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
    """Whether any pixel of `image` (H, W, 3) inside `mask` (H, W) bool, not empty, differs between
    its channels by more than rounding.
    """
    inside = image[mask]
    return bool((largest(inside) - smallest(inside)).max() > _GREY * inside.max())


def require_colour(image: np.ndarray, mask: np.ndarray, method: str) -> None:
    """Raises `InputError` where no pixel of `image` (H, W, 3) inside `mask` (H, W) bool has colour
    that the method could judge by.
    """
    if not has_colour(image, mask):
        raise InputError(
            f"the photo has no colour, and {method} tells highlights by colour alone: use --method "
            "isc, or a colour photo"
        )
