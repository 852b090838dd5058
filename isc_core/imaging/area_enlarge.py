"""Upsampling of an object by an interpolation that preserves the averages over its pixels.

Problem: pixels are averages over their areas. Linear interpolation between their centres blurs once
more, by an amount that varies with the position of the new centres between the old ones. A solution
from differences of neighbouring pixels then depends on the size of the photo.

Equation: the light is a quadratic spline f(x) = sum_k c_k B2(x - k) with the pixels' averages, (c *
B3)(k) = v_k, since averages of the B-spline B2 over pixels are values of B3. A new pixel is the
average of f over its area, so the averages of the new pixels over each old one are v, where an old
pixel is a whole number of new ones.

Citation: histosplines: L. I. Boneva, D. G. Kendall, I. Stefanov, "Spline transformations", Journal
of the Royal Statistical Society B 33, 1971, 1-70; B-splines of images: M. Unser, "Splines: a
perfect fit for signal and image processing", IEEE Signal Processing Magazine 16(6), 1999,
doi:10.1109/79.799930.

Limits: enlarging only; no detail is added beyond the photo's resolution. Near edges the spline
overshoots; values below the darkest of the neighbouring old pixels are raised to it.
"""

import numpy as np

from ..filters.distance import nearest_pixels
from ..filters.extrema import window_minimum
from ..filters.interpolation import resampled_plane
from ..filters.splines import spline_coefficients
from ..numerics.ellpack import Ellpack


def enlarge_averages(values: np.ndarray, inside: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Enlarge an image of an object, one axis after the other.

    Parameters
    ----------
    values : (H, W, C) ndarray
        Averages over pixels.
    inside : (H, W) bool ndarray
        The object, with at least one pixel; its values are extended beyond it.
    shape : tuple of int
        (h, w) of the result, neither side shorter.

    Returns
    -------
    (h, w, C) float64 ndarray
    """
    whole = np.asarray(values, float)[nearest_pixels(inside)]
    down, right = (_overlaps(old, new) for old, new in zip(inside.shape, shape, strict=True))
    places = np.ix_(*(_nearest(old, new) for old, new in zip(inside.shape, shape, strict=True)))
    found = np.empty((*shape, values.shape[2]))
    for channel in range(values.shape[2]):
        plane = whole[..., channel]
        enlarged = resampled_plane(spline_coefficients(plane), down, right)
        found[..., channel] = np.maximum(enlarged, window_minimum(plane, 3)[places])
    return found


def _nearest(size: int, new: int) -> np.ndarray:
    """Index of the old pixel, of `size`, that contains the centre of each new one."""
    return (2 * np.arange(new) + 1) * size // (2 * new)


def _overlaps(size: int, new: int) -> Ellpack:
    """(new, size) averages of the B-splines of degree 2 over the new pixels; the image is mirrored
    at its border.
    """
    edges = np.arange(new + 1) * (size / new)
    first = np.floor(edges[:-1]).astype(int) - 1
    column = first[:, None] + np.arange(4)  # a new pixel touches two old ones at most
    start, end = (ends[:, None] - column - 0.5 for ends in (edges[:-1], edges[1:]))
    weight = (_integral(end) - _integral(start)) * (new / size)
    mirrored = np.minimum(np.abs(column), 2 * (size - 1) - column)
    row = np.broadcast_to(np.arange(new)[:, None], column.shape)
    places = np.clip(mirrored, 0, size - 1)
    return Ellpack.of(row.ravel(), places.ravel(), weight.ravel(), (new, size))


def _integral(x: np.ndarray) -> np.ndarray:
    """The integral of the B-spline of degree 2, centred at 0, up to x."""
    powers = [np.maximum(x + knot, 0) ** 3 for knot in (1.5, 0.5, -0.5, -1.5)]
    return (powers[0] - 3 * powers[1] + 3 * powers[2] - powers[3]) / 6
