"""Objects of any size, centred in a square of fixed size."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isc_core.imaging.area_resize import averaged
from isc_core.imaging.bounding_box import mask_slices

_LARGEST_HALF = 6e4  # near the largest float16


@dataclass(frozen=True)
class PackedObject:
    """Layers of an object in a square.

    Attributes
    ----------
    layers : (K, 3, side, side) ndarray
        float32, 0 outside the mask.
    mask : (side, side) ndarray of bool
        Pixels of the object.
    """

    layers: np.ndarray
    mask: np.ndarray


def pack_object(
    layers: Sequence[np.ndarray], mask: np.ndarray, long_side: int, side: int
) -> PackedObject:
    """Reduce an object to at most `long_side` pixels and centre it.

    Parameters
    ----------
    layers : sequence of (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        Pixels of the object; not empty.
    long_side : int
        Largest extent of the object after reduction, in pixels.
    side : int
        Side of the square, in pixels; at least `long_side`.

    Returns
    -------
    PackedObject
        The layers at the new size.
    """
    box = mask_slices(mask)
    factor = min(1.0, long_side / max(mask[box].shape))
    small = [averaged(layer[box], mask[box], factor) for layer in layers]
    inside = small[0][1]
    top, left = ((side - n) // 2 for n in inside.shape)
    place = np.s_[..., top : top + inside.shape[0], left : left + inside.shape[1]]
    packed = np.zeros((len(small), 3, side, side), np.float32)
    cover = np.zeros((side, side), bool)
    packed[place] = np.stack([layer.transpose(2, 0, 1) for layer, _, _ in small])
    cover[place] = inside
    return PackedObject(packed, cover)


def as_half(layers: np.ndarray) -> np.ndarray:
    """Convert non-negative values to float16, clipped to its range.

    Parameters
    ----------
    layers : ndarray
        Not negative.

    Returns
    -------
    ndarray of float16
        Of the same shape.
    """
    return np.asarray(np.clip(layers, 0, _LARGEST_HALF), np.float16)
