"""Largest and smallest values in a window around each pixel.

Equation: the window of n pixels contains those from n // 2 before to (n - 1) // 2 beyond its
centre, as far as they lie on the image. Windows of n pixels are the union of two windows of half
the length, so that log2 n comparisons per axis suffice.

Citation: M. van Herk 1992, doi:10.1016/0167-8655(92)90069-C, has the time independent of n.
"""

from collections.abc import Callable

import numpy as np


def window_maximum(values: np.ndarray, size: int) -> np.ndarray:
    """Return the largest value in the window around each pixel.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
        Bool, or numbers.
    size : int
        Side of the square window in pixels.

    Returns
    -------
    ndarray
        Of the same shape.
    """
    return _extremum(np.maximum, values, size)


def window_minimum(values: np.ndarray, size: int) -> np.ndarray:
    """Return the smallest value in the window around each pixel.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
        Bool, or numbers.
    size : int
        Side of the square window in pixels.

    Returns
    -------
    ndarray
        Of the same shape.
    """
    return _extremum(np.minimum, values, size)


def opened(values: np.ndarray, size: int) -> np.ndarray:
    """Remove what is brighter than its surroundings and smaller than a square.

    Parameters
    ----------
    values : (H, W) ndarray
    size : int
        Side of the square in pixels, odd.

    Returns
    -------
    (H, W) ndarray
        The largest of the smallest values in the windows that contain a pixel.
    """
    return window_maximum(window_minimum(values, size), size)


def _extremum(of_two: Callable[..., np.ndarray], values: np.ndarray, size: int) -> np.ndarray:
    down = _along_rows(of_two, values, size)
    return np.ascontiguousarray(_along_rows(of_two, down.swapaxes(0, 1), size).swapaxes(0, 1))


def _along_rows(of_two: Callable[..., np.ndarray], values: np.ndarray, size: int) -> np.ndarray:
    """The extremum over the first axis; the border is repeated beyond the image, which changes no
    extremum. `runs[i]` is that of `length` pixels from i on.
    """
    before, beyond = size // 2, (size - 1) // 2
    runs = np.concatenate(
        [np.repeat(values[:1], before, axis=0), values, np.repeat(values[-1:], beyond, axis=0)]
    )
    length = 1
    while length < size:
        step = min(length, size - length)
        runs = of_two(runs[: len(runs) - step], runs[step:])
        length += step
    return runs
