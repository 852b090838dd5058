"""Parts of a map, cut out and put back: rectangles that may extend beyond it, pixels of a mask.

Limits: whole pixels.
"""

from dataclasses import dataclass

import numpy as np

from .framing import continued


def as_map(
    values: np.ndarray,
    mask: np.ndarray,
    outside: float = 0.0,
    dtype: type[np.floating] | None = None,
) -> np.ndarray:
    """Put the values of a mask's pixels back into a map.

    Parameters
    ----------
    values : (N, ...) ndarray
        In the order of `map[mask]`.
    mask : (H, W) bool ndarray
        N pixels are set.
    outside : float, optional
        Value of the other pixels.
    dtype : type, optional
        Of the map; by default that of the values.

    Returns
    -------
    (H, W, ...) ndarray
    """
    filled = np.full((*mask.shape, *values.shape[1:]), outside, dtype or values.dtype)
    filled[mask] = values
    return filled


@dataclass(frozen=True)
class Window:
    """A rectangle around the object, which may extend beyond the image.

    Attributes
    ----------
    top, left : int
        First row and column; may be negative.
    height, width : int
        Size in pixels.
    """

    top: int
    left: int
    height: int
    width: int

    def cut(self, array: np.ndarray, fill: float | bool) -> np.ndarray:
        """Cut the window out of an array.

        Parameters
        ----------
        array : (H, W, ...) ndarray
        fill : float or bool
            Value beyond the image.

        Returns
        -------
        (height, width, ...) ndarray
        """
        rows, columns = array.shape[:2]
        out = np.full((self.height, self.width, *array.shape[2:]), fill, array.dtype)
        a, b = max(self.top, 0), min(self.top + self.height, rows)
        c, d = max(self.left, 0), min(self.left + self.width, columns)
        out[a - self.top : b - self.top, c - self.left : d - self.left] = array[a:b, c:d]
        return out

    def cut_replicated(self, array: np.ndarray) -> np.ndarray:
        """Cut the window out of an array, replicating its border values.

        Parameters
        ----------
        array : (H, W) ndarray

        Returns
        -------
        (height, width) ndarray
        """
        rows, columns = (
            np.clip(np.arange(start, start + size), 0, n - 1)
            for start, size, n in zip(
                (self.top, self.left), (self.height, self.width), array.shape, strict=True
            )
        )
        return array[np.ix_(rows, columns)]

    def cut_silhouette(self, silhouette: np.ndarray) -> np.ndarray:
        """Cut the window out of a silhouette, extended where the frame cuts it.

        Parameters
        ----------
        silhouette : (H, W) bool ndarray

        Returns
        -------
        (height, width) bool ndarray
        """
        below = self.top + self.height - silhouette.shape[0]
        beyond = self.left + self.width - silhouette.shape[1]
        grown = continued(
            silhouette, max(-self.top, 0), max(below, 0), max(-self.left, 0), max(beyond, 0)
        )
        top, left = max(self.top, 0), max(self.left, 0)
        return grown[top : top + self.height, left : left + self.width]

    def put(self, window: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """Return an image with the content of the window, 0 elsewhere.

        Parameters
        ----------
        window : (height, width, ...) ndarray
        shape : tuple of int
            (H, W, ...) of the image.

        Returns
        -------
        (H, W, ...) ndarray
        """
        out = np.zeros(shape, window.dtype)
        a, b = max(self.top, 0), min(self.top + self.height, shape[0])
        c, d = max(self.left, 0), min(self.left + self.width, shape[1])
        out[a:b, c:d] = window[a - self.top : b - self.top, c - self.left : d - self.left]
        return out
