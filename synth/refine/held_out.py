"""Pixels that a fit does not see, and whether they are explained better after it.

Problem: a flexible light can lower the objective on the pixels that it was fitted to.

Equation: blocks of `BLOCK` x `BLOCK` pixels inside the mask are held out. A light explains a block
by the smoothness of the reflectance that it leaves there, q_b (`sirfs.reflectance`). With the
differences x_b = q_b(start) - q_b(new) of n blocks, it is better if mean(x) > `_SURE` sd(x) /
sqrt(n).

Citation: Student 1908, doi:10.1093/biomet/6.1.1.

Limits: what is held out is near to what is fitted. A smoother reflectance is a more probable one,
not always a truer one.
"""

import numpy as np

from isc_core.refinement.reflectance_terms import ReflectanceTerms
from isc_core.sirfs.reflectance import smoothness_cost

BLOCK = 8  # pixels
_SHARE = 0.1
_SURE = 2.0
_LEAST_BLOCKS = 4


def held_out_blocks(mask: np.ndarray, seed: int) -> np.ndarray:
    """Choose blocks inside a mask.

    Parameters
    ----------
    mask : (H, W) ndarray of bool
    seed : int

    Returns
    -------
    (B, 2) ndarray of int
        Their first row and column.
    """
    rows, columns = (n // BLOCK for n in mask.shape)
    whole = mask[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK)
    inside = np.argwhere(whole.all(axis=(1, 3))) * BLOCK
    wanted = min(len(inside), round(_SHARE * int(mask.sum()) / BLOCK**2))
    chosen = np.random.default_rng(seed).permutation(len(inside))[:wanted]
    return inside[np.sort(chosen)]


def fitted_weight(mask: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Return 1 for pixels of the mask that are not held out, else 0.

    Parameters
    ----------
    mask : (H, W) ndarray of bool
    blocks : (B, 2) ndarray of int
        Of `held_out_blocks`.

    Returns
    -------
    (H, W) ndarray of float64
    """
    weight = mask.astype(float)
    for row, column in blocks:
        weight[row : row + BLOCK, column : column + BLOCK] = 0
    return weight


def explains_better(
    terms: ReflectanceTerms, blocks: np.ndarray, start: np.ndarray, new: np.ndarray
) -> bool:
    """Decide whether a new shading explains held-out blocks better than the start's.

    Parameters
    ----------
    terms : ReflectanceTerms
    blocks : (B, 2) ndarray of int
    start, new : (N, 3) ndarray
        Shading of the mask's pixels.

    Returns
    -------
    bool
        False for too few blocks.
    """
    if len(blocks) < _LEAST_BLOCKS:
        return False
    gain = _roughness(terms, blocks, start) - _roughness(terms, blocks, new)
    return bool(gain.mean() > _SURE * gain.std(ddof=1) / np.sqrt(len(blocks)))


def _roughness(terms: ReflectanceTerms, blocks: np.ndarray, shading: np.ndarray) -> np.ndarray:
    values, weight = terms.log_reflectance(shading), np.ones((BLOCK, BLOCK))
    return np.array(
        [
            smoothness_cost(
                values[row : row + BLOCK, column : column + BLOCK], weight, terms.priors, 1.0
            )[0]
            for row, column in blocks
        ]
    )
