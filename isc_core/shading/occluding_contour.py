"""Where the surface turns away from the viewer: points of the occluding contour and their outward
normals.

Equation: a contour point is a mask pixel with a 4-neighbour inside the image and outside the mask;
its normal is minus the Gaussian-weighted mean offset of the mask pixels in an 11 x 11 window.

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712.

Limits: where the photo's frame cuts the object there is no contour, and a window that contains the
cut gives no normal.
"""

from dataclasses import dataclass

import numpy as np

from ..filters.correlation import correlated
from ..filters.extrema import window_maximum

RADIUS = 5


@dataclass(frozen=True, eq=False)
class Contour:
    """Points of an occluding contour.

    Attributes
    ----------
    rows, columns : (P,) int64 ndarray
        Pixels.
    down, right : (P,) ndarray
        Components of the unit outward normal in the image plane.
    """

    rows: np.ndarray
    columns: np.ndarray
    down: np.ndarray
    right: np.ndarray


def occluding_contour(mask: np.ndarray, *, drop_near_edge: bool = False) -> Contour:
    """Find the occluding contour of a mask.

    Parameters
    ----------
    mask : (H, W) bool ndarray
    drop_near_edge : bool
        Drop every point nearer than 5 pixels to the frame, as the published code does. By default
        points are dropped only where the frame cuts the object within the window, so that empty
        padding around the photo changes nothing.

    Returns
    -------
    Contour
    """
    padded = np.pad(mask, 1, mode="edge")
    outside = ~padded
    touches = outside[:-2, 1:-1] | outside[2:, 1:-1] | outside[1:-1, :-2] | outside[1:-1, 2:]
    keep = mask & touches
    if drop_near_edge:
        inner = np.zeros_like(mask)
        inner[RADIUS:-RADIUS, RADIUS:-RADIUS] = True
        keep &= inner
    else:
        cut = np.zeros_like(mask)
        cut[[0, -1], :] = mask[[0, -1], :]
        cut[:, [0, -1]] |= mask[:, [0, -1]]
        keep &= ~window_maximum(cut, 2 * RADIUS + 1)
    offset = np.arange(-RADIUS, RADIUS + 1, dtype=float)
    bell = np.exp(-5.0 * offset**2 / RADIUS**2)
    filled = mask.astype(float)
    down = _window_sum(filled, offset * bell, bell)
    right = _window_sum(filled, bell, offset * bell)
    length = np.hypot(down, right)
    rows, columns = np.nonzero(keep & (length > 1e-12))
    length = length[rows, columns]
    return Contour(rows, columns, -down[rows, columns] / length, -right[rows, columns] / length)


def _window_sum(image: np.ndarray, along_rows: np.ndarray, along_columns: np.ndarray) -> np.ndarray:
    return correlated(correlated(image, along_rows, axis=0), along_columns, axis=1)
