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
from ..imaging.row_blocks import row_blocks

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
    return _pull_push(
        np.where(known[..., None], values, 0).astype(np.float32), known.astype(np.float32)
    )


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
    parts = []
    for block in row_blocks((-(-len(known) // 2), known.shape[1])):
        rows = slice(2 * block.rows.start, 2 * block.rows.stop)
        here = known[rows]
        inside = np.where(here[..., None], values[rows], 0).astype(np.float32)
        parts.append(pull(inside, here.astype(np.float32)))
    coarse = _pull_push(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    return _pushed(coarse, np.nonzero(wanted))


def _pull_push(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    if weight.all():
        return values
    return push(values, weight > 0, _pull_push(*pull(values, weight)))


def pull(values: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Average 2 x 2 blocks over their known pixels.

    Parameters
    ----------
    values : (H, W, C) ndarray
    weight : (H, W) ndarray

    Returns
    -------
    values, weight
        Half as wide and high; a block is known if any of its pixels is.
    """
    total = _sum_of_blocks(weight)
    mean = _sum_of_blocks(values * weight[..., None]) / np.maximum(total, 1)[..., None]
    return mean, (total > 0).astype(np.float32)


def _sum_of_blocks(values: np.ndarray) -> np.ndarray:
    """Sums over 2 x 2 blocks of `values` (H, W, ...), padded by zeros to even sides."""
    even = np.pad(values, [(0, n % 2) for n in values.shape[:2]] + [(0, 0)] * (values.ndim - 2))
    rows = even[::2] + even[1::2]
    return rows[:, ::2] + rows[:, 1::2]


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
        filled[at] = _pushed(coarse, at)
        return filled
    # across first, as in `_pushed`: the last digits are the same
    upsampled = doubled(coarse.swapaxes(0, 1)).swapaxes(0, 1)
    height, width = known.shape
    return np.where(missing[..., None], upsampled[:height, :width], values)


def _pushed(coarse: np.ndarray, at: tuple[np.ndarray, ...]) -> np.ndarray:
    """The values (n, C) of a coarser level at fine pixels."""
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
