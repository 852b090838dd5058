"""The connected components of a mask."""

import numpy as np

from ..filters.components import labelled
from ..imaging.bounding_box import mask_box

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
    labels, areas = _labels_and_areas(mask)
    chosen = np.flatnonzero(areas >= max(share * areas.max(), 1))
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
    return _count(mask, _SMALL) == 1


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
    """The number of `connected_components`."""
    _, areas = _labels_and_areas(mask)
    return int((areas >= max(share * areas.max(), 1)).sum())


def _labels_and_areas(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Labels (H, W), 0 outside the mask, and the area of each label, 0 for label 0."""
    labels, count = labelled(mask, corners=True)
    return labels, np.bincount(labels[mask], minlength=count + 1)
