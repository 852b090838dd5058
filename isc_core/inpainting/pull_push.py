"""Smooth interpolation of unknown pixels by pull-push (Gortler et al. 1996).

Problem: interpolate values known at some pixels to all of them.

Equation: known pixels are averaged over 2 x 2 blocks down a pyramid (pull); from the top, holes are
filled by bilinear interpolation of the finest known level (push). The time is linear in the pixels.

Citation: S. J. Gortler, R. Grzeszczuk, R. Szeliski and M. F. Cohen, "The Lumigraph", SIGGRAPH 1996,
43-54, doi:10.1145/237170.237200.

Limits: the fill is smooth, without texture.
"""

import numpy as np

from ..imaging.doubling import doubled
from ..imaging.row_blocks import CACHED, row_blocks

_FEW = 0.2  # of the pixels: so few are looked up one by one


def fill(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Interpolate all pixels that are not known.

    Parameters
    ----------
    values : (H, W, C) ndarray
    known : (H, W) bool ndarray
        At least one pixel.

    Returns
    -------
    (H, W, C) float32 ndarray
    """
    return _pull_push(values.astype(np.float32), known)


def fill_at(values: np.ndarray, known: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Interpolate some pixels that are not known; needs less memory than `fill`.

    Parameters
    ----------
    values : (H, W, C) float32 ndarray
    known : (H, W) bool ndarray
        At least one pixel.
    wanted : (H, W) bool ndarray
        None of them is known.

    Returns
    -------
    (n, C) float32 ndarray
        The values of `fill` at these pixels.
    """
    return pushed_at(_pull_push(*pull(values, known)), np.nonzero(wanted))


def _pull_push(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    if known.all():
        return values
    return push(values, known, _pull_push(*pull(values, known)))


def pull(values: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Average 2 x 2 blocks over their known pixels.

    Parameters
    ----------
    values : (H, W, C) ndarray
    known : (H, W) bool ndarray

    Returns
    -------
    values : (h, w, C) float32 ndarray
        Half as wide and high, 0 where nothing is known.
    known : (h, w) bool ndarray
        Whether any pixel of a block is known.
    """
    half = tuple(-(-size // 2) for size in known.shape)
    means, count = np.empty((*half, values.shape[2]), np.float32), np.empty(half, np.float32)
    for block in row_blocks(half, pixels=CACHED):
        rows = slice(2 * block.rows.start, 2 * block.rows.stop)
        here = known[rows]
        inside = np.where(here[..., None], values[rows], 0).astype(np.float32, copy=False)
        count[block.rows] = number = _sum_of_blocks(here.astype(np.float32))
        means[block.rows] = _sum_of_blocks(inside) / np.maximum(number, 1)[..., None]
    return means, count > 0


def _sum_of_blocks(values: np.ndarray) -> np.ndarray:
    """Sums over 2 x 2 blocks of `values` (H, W, ...), with zeros beyond odd sides."""
    for axis in (0, 1):
        lines = np.moveaxis(values, axis, 0)
        sums, others = lines[::2].copy(), lines[1::2]
        sums[: len(others)] += others
        values = np.moveaxis(sums, 0, axis)
    return values


def push(values: np.ndarray, known: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """Fill the unknown pixels from a coarser level, upsampled bilinearly.

    Pixel centres are aligned: each fine pixel is 3/4 of its block's value and 1/4 of the next
    one's, along both axes.

    Parameters
    ----------
    values : (H, W, C) ndarray
    known : (H, W) bool ndarray
    coarse : (h, w, C) ndarray
        Half as wide and high.

    Returns
    -------
    (H, W, C) ndarray
    """
    missing = ~known
    if np.count_nonzero(missing) < _FEW * known.size:
        at = np.nonzero(missing)
        filled = values.copy()
        filled[at] = pushed_at(coarse, at)
        return filled
    # across first, as in `_pushed`: the last digits are the same
    upsampled = doubled(coarse.swapaxes(0, 1)).swapaxes(0, 1)
    height, width = known.shape
    return np.where(missing[..., None], upsampled[:height, :width], values)


def pushed_at(coarse: np.ndarray, at: tuple[np.ndarray, ...]) -> np.ndarray:
    """Upsample a coarser level at some pixels, see `push`.

    Parameters
    ----------
    coarse : (h, w, C) ndarray
    at : tuple of (n,) ndarray
        Rows and columns of the finer level.

    Returns
    -------
    (n, C) ndarray
    """
    (row, next_row), (column, next_column) = (
        _nearest_blocks(index, size) for index, size in zip(at, coarse.shape, strict=False)
    )
    upper = 0.75 * coarse[row, column] + 0.25 * coarse[row, next_column]
    lower = 0.75 * coarse[next_row, column] + 0.25 * coarse[next_row, next_column]
    return np.asarray(0.75 * upper + 0.25 * lower)


def _nearest_blocks(index: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The block, of `size`, that contains a fine pixel, and the nearest of its neighbours."""
    near = index // 2
    return near, np.clip(near - 1 + index % 2 * 2, 0, size - 1)
