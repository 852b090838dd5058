"""Held-out blocks of pixels, which validate a fit.

Equation: the blocks of a grid are sorted by their light, and every n-th is held out, starting at a
random one, so that bright and dark blocks are held out equally.

Citation: M. Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x.

Limits: held-out pixels are close to fitted ones.
"""

import numpy as np


def held_out_blocks(
    light: np.ndarray, side: int, every: int, seed: int, candidates: np.ndarray | None = None
) -> np.ndarray:
    """Choose blocks.

    Parameters
    ----------
    light : (H, W) ndarray
        The light to be explained; 0 outside the object.
    side : int
        Of a block, pixels.
    every : int
        One in this many blocks is chosen.
    seed : int
        Of the random choice of the first one.
    candidates : (H, W) ndarray of bool, optional
        Blocks that are not completely inside are excluded.

    Returns
    -------
    (B, 2) ndarray of int
        Their first row and column, in row order; blocks may extend beyond the image.
    """
    bright = _grid(light, side).sum(axis=(1, 3))
    allowed = np.ones(bright.shape, bool)
    if candidates is not None:
        allowed = _grid(candidates, side).all(axis=(1, 3))
    blocks = np.argwhere(allowed)
    first = int(np.random.default_rng(seed).integers(every))
    chosen = np.argsort(-bright[allowed], kind="stable")[first::every]
    return blocks[np.sort(chosen)] * side


def pixels_of(blocks: np.ndarray, side: int, shape: tuple[int, ...]) -> np.ndarray:
    """Return which pixels lie in blocks.

    Parameters
    ----------
    blocks : (B, 2) ndarray of int
        From `held_out_blocks`.
    side : int
    shape : tuple of int
        (H, W).

    Returns
    -------
    (H, W) ndarray of bool
    """
    chosen = np.zeros(shape, bool)
    for row, column in blocks:
        chosen[row : row + side, column : column + side] = True
    return chosen


def _grid(values: np.ndarray, side: int) -> np.ndarray:
    """Values as (rows, side, columns, side), with 0 beyond the image."""
    rows, columns = (n // side + 1 for n in values.shape)
    padded = np.zeros((rows * side, columns * side), values.dtype)
    padded[: values.shape[0], : values.shape[1]] = values
    return padded.reshape(rows, side, columns, side)
