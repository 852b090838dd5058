"""Crops an image to an object, so that empty background takes no time and does not affect the
result.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError

MARGIN = 3


@dataclass(frozen=True)
class Box:
    """Bounding box of a mask, with a margin.

    Attributes
    ----------
    shape : tuple of int
        The frame's (H, W).
    rows, columns : tuple of int
        [start, stop) of the box.
    around : tuple of tuple of int
        Empty pixels around it: (above, below), (left, right); 0 where the frame cuts off the
        object, which has no contour there.
    """

    shape: tuple[int, int]
    rows: tuple[int, int]
    columns: tuple[int, int]
    around: tuple[tuple[int, int], tuple[int, int]]

    @classmethod
    def of(cls, mask: np.ndarray) -> "Box":
        """Return the box of a mask.

        Parameters
        ----------
        mask : (H, W) bool ndarray

        Returns
        -------
        Box

        Raises
        ------
        InputError
            If the mask is empty.
        """
        if not mask.any():
            raise InputError("the mask is empty: mark at least the object's pixels")
        spans, margins = [], []
        for axis in (0, 1):
            used = np.flatnonzero(mask.any(axis=1 - axis))
            start, stop = int(used[0]), int(used[-1]) + 1
            spans.append((start, stop))
            margins.append((MARGIN * (start > 0), MARGIN * (stop < mask.shape[axis])))
        return cls((mask.shape[0], mask.shape[1]), spans[0], spans[1], (margins[0], margins[1]))

    def crop(self, array: np.ndarray) -> np.ndarray:
        """Crop an array to the box and surround it with its margin of zeros.

        Parameters
        ----------
        array : (H, W, ...) ndarray
            Of the frame.

        Returns
        -------
        (h, w, ...) ndarray
            Box and margin.
        """
        inside = array[slice(*self.rows), slice(*self.columns)]
        return np.pad(inside, [*self.around, *[(0, 0)] * (array.ndim - 2)])

    def place(self, cropped: np.ndarray) -> np.ndarray:
        """Put the box with its margin back into the frame, which is filled with the nearest values.

        Parameters
        ----------
        cropped : (h, w, ...) ndarray
            Of the box with its margin.

        Returns
        -------
        (H, W, ...) ndarray
        """
        for axis, (start, stop) in enumerate((self.rows, self.columns)):
            first = start - self.around[axis][0]
            last = stop + self.around[axis][1]
            at = np.clip(np.arange(self.shape[axis]), first, last - 1) - first
            cropped = np.take(cropped, at, axis=axis)
        return cropped
