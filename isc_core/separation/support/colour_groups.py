"""Groups of pixels of one paint, told by what a white highlight does not change, and robust
statistics of them.

Problem: which pixels show the same paint, highlight or not? Equation: white light leaves the
two-band image F = I - min I as it is, hence also the shares of red and green in it, F_R / sum F and
F_G / sum F, which depend on the paint alone. Pixels in one cell of that plane form a group. Limits:
a paint and its paler relation have like shares; where F is small the shares are noise, which an
average of F over a few pixels tames.
"""

import numpy as np
from scipy import ndimage

from ...imaging.channels import smallest


def two_band_shares(
    image: np.ndarray, known: np.ndarray, window: int
) -> tuple[np.ndarray, np.ndarray]:
    """Shares of red and green (H, W), in [0, 1], in F averaged over the `known` (H, W) pixels of a
    square of `window` pixels a side.

    `image` (H, W, 3); `window` odd. 0 where not known, or without any colour.
    """
    low = smallest(image)
    band = image[..., 0] + image[..., 1] + image[..., 2] - 3 * low
    layers = [
        np.where(known, layer, 0) for layer in (image[..., 0] - low, image[..., 1] - low, band)
    ]
    if window > 1:
        layers = [ndimage.uniform_filter(layer, window, mode="constant") for layer in layers]
    known = known & (layers[2] > 0)
    over = np.where(known, layers[2], 1)
    red, green = (np.where(known, layer / over, 0) for layer in layers[:2])
    return red, green


def colour_cells(red: np.ndarray, green: np.ndarray, cells: int) -> np.ndarray:
    """The cell, from 0 to `cells`**2 - 1, of shares (n,) of red and green: the plane has `cells` of
    them a side.
    """
    row, column = (np.clip(share * cells, 0, cells - 1).astype(np.int64) for share in (red, green))
    return row * cells + column


def group_quantile(group: np.ndarray, values: np.ndarray, quantile: float) -> np.ndarray:
    """For each of `values` (n,) the lower `quantile` of all those with the same whole number >= 0
    in `group` (n,).
    """
    order = np.argsort(values)
    order = order[np.argsort(group[order], kind="stable")]
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    sizes = np.diff(starts, append=len(group))
    found = np.empty_like(values)
    found[order] = np.repeat(
        values[order[starts + (quantile * (sizes - 1)).astype(np.int64)]], sizes
    )
    return found
