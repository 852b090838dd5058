"""Means over square blocks of pixels."""

import numpy as np


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
