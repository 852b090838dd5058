"""Differences over the pairs of neighbouring pixels on which SIRFS measures smoothness.

The pairs are those of the objective (`problem.PAIR_OFFSETS`): two pixels in one 5x5 window, each
unordered pair once.

Citation: J. T. Barron, J. Malik (2015), "Shape, illumination, and reflectance from shading",
doi:10.1109/TPAMI.2014.2377712.
"""

import numpy as np

from ..sirfs.problem import PAIR_OFFSETS
from ..sirfs.surface import pair_slices


def pair_differences(values: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return the differences over all pairs of valid pixels.

    Parameters
    ----------
    values : (H, W) or (H, W, C) ndarray
        Never read outside `valid`.
    valid : (H, W) bool ndarray

    Returns
    -------
    (pairs,) or (pairs, C) ndarray
        Grouped by offset.
    """
    differences = []
    for offset in PAIR_OFFSETS:
        p, q = pair_slices(*offset)
        both = valid[p] & valid[q]
        differences.append(values[p][both] - values[q][both])
    return np.concatenate(differences)
