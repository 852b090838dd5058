"""The connected components of a mask."""

import numpy as np

from ..filters.components import labelled
from ..imaging.bounding_box import mask_box, mask_slices
from ..imaging.row_blocks import row_blocks

_SMALL = 0.1  # of the largest component's area: smaller ones do not count
_SEVERAL = 0.3  # of the largest component's area: a second one as large is another object


def connected_components(mask: np.ndarray, share: float = _SMALL) -> list[np.ndarray]:
    """Return the connected components of a mask (8 neighbours), without small ones.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    share : float
        Minimum area of a component, relative to that of the largest.

    Returns
    -------
    list of (H, W) bool ndarray
        From left to right.
    """
    labels, chosen = _chosen_labels(mask, share)
    components = [labels == number for number in chosen]
    return sorted(components, key=lambda component: mask_box(component)[:2])


def is_one_piece(mask: np.ndarray) -> bool:
    """Return whether a mask has one component; small ones do not count.

    Parameters
    ----------
    mask : (H, W) bool ndarray

    Returns
    -------
    bool
    """
    return bool(mask.any()) and _count(mask, _SMALL) == 1


def shows_several(mask: np.ndarray) -> bool:
    """Return whether a mask shows several objects.

    Parameters
    ----------
    mask : (H, W) bool ndarray
        Not empty.

    Returns
    -------
    bool
        Whether a second component is about as large as the first.
    """
    return _count(mask, _SEVERAL) > 1


def _count(mask: np.ndarray, share: float) -> int:
    """The number of components that are not small, of a mask that is not empty."""
    return len(_chosen_labels(mask[mask_slices(mask)], share)[1])


def _chosen_labels(mask: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """The labels (H, W) of the components, and those of the components that are not small."""
    labels, count = labelled(mask, corners=True)
    areas = np.zeros(count + 1, np.int64)
    for block in row_blocks(mask.shape):
        areas += np.bincount(labels[block.rows].ravel(), minlength=count + 1)
    areas[0] = 0
    return labels, np.flatnonzero(areas >= max(share * areas.max(), 1))
