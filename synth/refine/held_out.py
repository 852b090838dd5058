"""Test whether a new light explains held-out pixels better than the start's.

Problem: a flexible light can lower the objective on the pixels that it was fitted to.

Equation: of blocks of `BLOCK` x `BLOCK` pixels inside the mask, one in `EVERY` is held out, see
`isc_core.refinement.held_out`; blocks are balanced by the start's shading. The score of a block
under a light is the smoothness of its reflectance, q_b (`sirfs.reflectance`). With the differences
x_b = q_b(start) - q_b(new) of n blocks, it is better if mean(x) > `_SURE` sd(x) / sqrt(n).

Citation: Student 1908, doi:10.1093/biomet/6.1.1.

Limits: those of `isc_core.refinement.held_out`. A smoother reflectance is more probable, but not
always more accurate.
"""

import numpy as np

from isc_core.refinement.reflectance_terms import ReflectanceTerms
from isc_core.sirfs.reflectance import smoothness_cost

BLOCK, EVERY = 8, 10  # pixels; one of so many blocks is held out
_SURE = 2.0
_LEAST_BLOCKS = 4


def explains_better(
    terms: ReflectanceTerms, blocks: np.ndarray, start: np.ndarray, new: np.ndarray
) -> bool:
    """Decide whether a new shading explains held-out blocks better than the start's.

    Parameters
    ----------
    terms : ReflectanceTerms
    blocks : (B, 2) ndarray of int
        Their first row and column.
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
