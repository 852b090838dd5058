# mypy: disable-error-code="no-untyped-def"
"""Votes of matched patches for their pixels: a weighted mean.

Equation: a pixel under the target patches p becomes sum_p w_p v_p / sum_p w_p, with v_p the value
at the corresponding pixel of p's match and w_p = exp(-d_p / (2 s) - l_p): d_p is the squared
distance of p to its match, s the upper quartile of all d, l_p an optional penalty.

Citation: see `patch_fill`.
"""

import numpy as np

from ..numerics.jit import jit
from .coherency_sensitive_hashing import Matches, Patches

# Weights below exp(-60) are negligible but must not vanish: they are used where all patches match
# badly.
_LEAST = -60.0


def vote(
    values: np.ndarray,
    target: Patches,
    source: Patches,
    matches: Matches,
    loss: np.ndarray | float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Average the votes of the matches at each pixel.

    Parameters
    ----------
    values : (h, w, C) ndarray
        The source image.
    target, source : Patches
    matches : Matches
    loss : (n,) ndarray or float
        l_p, not negative.

    Returns
    -------
    values : (H, W, C) float64 ndarray
        0 without votes.
    has_votes : (H, W) bool ndarray
    """
    height, width = target.index.shape
    scale = 2 * max(float(np.quantile(matches.distance, 0.75)), 1e-12) if len(target) else 1.0
    weight = np.exp(np.maximum(-matches.distance.astype(np.float64) / scale - loss, _LEAST))
    total = np.zeros((height, width, values.shape[2] + 1))
    _add_votes(
        values,
        target.rows,
        target.columns,
        source.rows,
        source.columns,
        matches.source,
        weight,
        total,
    )
    has_votes = total[..., -1] > 0
    return total[..., :-1] / np.where(has_votes, total[..., -1], 1)[..., None], has_votes


@jit(types="f4[3] i8[1:] i8[1:] i8[1:] i8[1:] i4[1] f8[1] f8[3]")
def _add_votes(image, rows, columns, source_rows, source_columns, matches, weight, total):
    """total[..., :C] += weight times the matched patch, total[..., C] += weight, over every target
    patch's pixels.
    """
    channels = image.shape[2]
    for i in range(rows.shape[0]):
        row, column = source_rows[matches[i]], source_columns[matches[i]]
        for a in range(8):
            for b in range(8):
                for c in range(channels):
                    total[rows[i] + a, columns[i] + b, c] += (
                        weight[i] * image[row + a, column + b, c]
                    )
                total[rows[i] + a, columns[i] + b, channels] += weight[i]
