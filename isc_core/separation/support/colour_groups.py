"""Groups of pixels of one reflectance, by highlight-invariant colour, and their robust statistics.

Problem: which pixels show the same reflectance, highlight or not?

Equation: white light leaves the two-band image F = I - min I unchanged, hence also its shares of
red and green, F_R / sum F and F_G / sum F, which depend on the reflectance alone. Pixels in one
cell of that plane form a group.

Limits: a colour and a paler version of it have similar shares; where F is small the shares are
noise, which an average of F over a few pixels reduces.
"""

import numpy as np

from ...filters.box import box_average
from ...imaging.channels import smallest


def two_band_shares(
    image: np.ndarray, valid: np.ndarray, window: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the shares of red and green in the averaged two-band image.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    valid : (H, W) bool ndarray
    window : int
        Side of the averaging square in pixels; odd.

    Returns
    -------
    red, green : (H, W) ndarray
        In [0, 1]; 0 where not valid, or without colour.
    """
    low = smallest(image)
    band = image[..., 0] + image[..., 1] + image[..., 2] - 3 * low
    layers = [
        np.where(valid, layer, 0) for layer in (image[..., 0] - low, image[..., 1] - low, band)
    ]
    if window > 1:
        layers = [box_average(layer, window) for layer in layers]
    valid = valid & (layers[2] > 0)
    over = np.where(valid, layers[2], 1)
    red, green = (np.where(valid, layer / over, 0) for layer in layers[:2])
    return red, green


def colour_cells(red: np.ndarray, green: np.ndarray, cells: int) -> np.ndarray:
    """Return the cell of each pair of colour shares on a square grid.

    Parameters
    ----------
    red, green : (n,) ndarray
        Shares of red and green, in [0, 1].
    cells : int
        Cells along each axis.

    Returns
    -------
    (n,) int64 ndarray
        From 0 to `cells`**2 - 1; red counts rows, green columns.
    """
    row, column = (np.clip(share * cells, 0, cells - 1).astype(np.int64) for share in (red, green))
    return row * cells + column


def group_quantile(group: np.ndarray, values: np.ndarray, quantile: float) -> np.ndarray:
    """Return for each value the lower quantile of its group.

    Parameters
    ----------
    group : (n,) int ndarray
        Not negative.
    values : (n,) ndarray
    quantile : float

    Returns
    -------
    (n,) ndarray
    """
    order = np.argsort(values)
    order = order[np.argsort(group[order], kind="stable")]
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    sizes = np.diff(starts, append=len(group))
    quantiles = np.empty_like(values)
    quantiles[order] = np.repeat(
        values[order[starts + (quantile * (sizes - 1)).astype(np.int64)]], sizes
    )
    return quantiles
