"""Means over square blocks of pixels."""

import numpy as np

_LEAST = 1e-9  # of a share


def block_means(values: np.ndarray, side: int) -> np.ndarray:
    """Average blocks of pixels.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
        H and W are multiples of `side`.
    side : int
        Pixels of a block's side, b.

    Returns
    -------
    (H / b, W / b) or (H / b, W / b, C) ndarray
    """
    rows, columns = (n // side for n in values.shape[:2])
    blocks = values.reshape(rows, side, columns, side, *values.shape[2:])
    return np.asarray(blocks.mean(axis=(1, 3)))


def means_inside(values: np.ndarray, mask: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Average the pixels of each block that are inside a mask.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
        Floats; H and W are multiples of `side`.
    mask : (H, W) ndarray of bool
    side : int
        Pixels of a block's side, b.

    Returns
    -------
    means : (H / b, W / b) or (H / b, W / b, C) ndarray
        0 where nothing is inside.
    share : (H / b, W / b) ndarray
        Share of the block that is inside.
    """
    planes = values.reshape(*mask.shape, -1)
    share = block_means(mask.astype(values.dtype), side)
    sums = block_means(np.where(mask[..., None], planes, 0), side)
    means = sums / np.maximum(share, _LEAST)[..., None]
    return means.reshape(*share.shape, *values.shape[2:]), share


def padded_means_inside(
    values: np.ndarray, mask: np.ndarray, side: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return `means_inside` of maps of any size: nothing is inside beyond their border.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
        Floats.
    mask : (H, W) ndarray of bool
    side : int
        Pixels of a block's side, b.

    Returns
    -------
    means : (ceil(H / b), ceil(W / b)) or (ceil(H / b), ceil(W / b), C) ndarray
        0 where nothing is inside.
    share : (ceil(H / b), ceil(W / b)) ndarray
        Share of the block that is inside.
    """
    more = [(0, -n % side) for n in mask.shape]
    rest = [(0, 0)] * (values.ndim - 2)
    return means_inside(np.pad(values, [*more, *rest]), np.pad(mask, more), side)
