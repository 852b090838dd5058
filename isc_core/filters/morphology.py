"""Binary morphology with small structuring elements.

Equation: the dilation of a mask is the union of its shifts by the element's offsets, its erosion
the complement of the dilation of the complement by the mirrored element; an opening is an erosion
and then a dilation. Pixels beyond the border are background, unless said otherwise.

Citation: J. Serra, "Image Analysis and Mathematical Morphology", Academic Press, 1982.
"""

import numpy as np


def dilated(mask: np.ndarray, steps: int = 1, square: bool = False) -> np.ndarray:
    """Grow a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    steps : int
        How often each pixel spreads to its neighbours.
    square : bool
        Whether the eight neighbours count; otherwise four.

    Returns
    -------
    (H, W) bool ndarray
    """
    grown = mask
    for _ in range(steps):
        source, grown = grown, grown.copy()
        grown[:, 1:] |= source[:, :-1]
        grown[:, :-1] |= source[:, 1:]
        row = grown.copy() if square else source
        grown[1:] |= row[:-1]
        grown[:-1] |= row[1:]
    return grown


def eroded(mask: np.ndarray, steps: int = 1, beyond: bool = False) -> np.ndarray:
    """Shrink a mask by pixels of which one of the four neighbours is background.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    steps : int
        How often.
    beyond : bool
        Whether the mask continues beyond the border.

    Returns
    -------
    (H, W) bool ndarray
    """
    shrunk = mask
    for _ in range(steps):
        wide = np.pad(shrunk, 1, constant_values=beyond)
        shrunk = shrunk & wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:]
    return shrunk


def opened_by_blocks(mask: np.ndarray) -> np.ndarray:
    """Return the union of all blocks of 2 x 2 pixels inside a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W) bool ndarray
    """
    whole = mask[1:, 1:] & mask[1:, :-1] & mask[:-1, 1:] & mask[:-1, :-1]
    covered = np.zeros_like(mask)
    covered[1:, 1:] |= whole
    covered[1:, :-1] |= whole
    covered[:-1, 1:] |= whole
    covered[:-1, :-1] |= whole
    return covered
