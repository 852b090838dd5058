"""How sure a mask is.

Problem: a photo of no single thing, or of one that the network cannot tell from what is around it,
should be refused, not masked.

Equation: the log odds of a right mask are w_0 + w_1 l(p_1) + w_2 l(p_2) + w_3 l(o) + w_4 l(f_1) +
w_5 l(f_2) for the log odds l of the probabilities p of one thing at both looks, of their overlap o,
and of how firm both are, f = 1 - 2 (sum c (1 - c)) / (sum c) for the cover c: 1 where every pixel
is told with certainty, 0 where all are even odds. w is fitted
(`training.masks.mask_calibration`).

Citation: J. Platt, "Probabilistic outputs for support vector machines", 1999.

Limits: fitted to photos without hints. With hints, the looks have seen them, and the probability is
multiplied by the share of points that the mask obeys; docs/methods/automatic_mask.md tells what it
is then worth.
"""

import math

import numpy as np

from ..networks.mask_network import SURENESS, Count
from .frames import PartPrediction

_UNSURE = 1e-3
_LEAST = 1e-6
_OVERLAP = 3  # place of the overlap's log odds


def evidence_of(first: PartPrediction, second: PartPrediction, before: np.ndarray) -> np.ndarray:
    """Return what sureness is computed from.

    Parameters
    ----------
    first, second : PartPrediction
        At the whole photo and at a part of it.
    before : (height, width) ndarray
        The first look's cover of that part.

    Returns
    -------
    (SURENESS,) ndarray
        1, and log odds.
    """
    shares = [
        float(first.counts[Count.ONE]),
        float(second.counts[Count.ONE]),
        _overlap(before, second.cover),
        _firmness(first.cover),
        _firmness(second.cover),
    ]
    return _log_odds(np.array(shares))


def of_another_mask(evidence: np.ndarray, looked: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Return the evidence of a mask that was taken in place of the network's.

    Parameters
    ----------
    evidence : (SURENESS,) ndarray
        As `evidence_of`.
    looked, taken : (H, W) ndarray
        Covers: the network's, and that of the mask.

    Returns
    -------
    (SURENESS,) ndarray
        The overlap is that of both, where it is less than that of the looks.
    """
    overlap = _log_odds(np.array([_overlap(looked, taken)]))[1]
    changed = evidence.copy()
    changed[_OVERLAP] = min(changed[_OVERLAP], overlap)
    return changed


def no_evidence(first: PartPrediction) -> np.ndarray:
    """Return the evidence of a photo in which nothing is found.

    Parameters
    ----------
    first : PartPrediction
        At the whole photo.

    Returns
    -------
    (SURENESS,) ndarray
        As `evidence_of`.
    """
    found = np.zeros(SURENESS - 1)
    found[0] = first.counts[Count.ONE]
    return _log_odds(found)


def sureness_of(evidence: np.ndarray, weights: np.ndarray) -> float:
    """Return the probability that a mask is right.

    Parameters
    ----------
    evidence, weights : (SURENESS,) ndarray

    Returns
    -------
    float
    """
    return 1 / (1 + math.exp(-float((weights * evidence).sum())))


def _overlap(one: np.ndarray, other: np.ndarray) -> float:
    smaller, larger = (
        float(join(one, other).sum(dtype=float)) for join in (np.minimum, np.maximum)
    )
    return smaller / max(larger, _LEAST)


def _firmness(cover: np.ndarray) -> float:
    doubt = float((cover * (1 - cover)).sum(dtype=float))
    return 1 - 2 * doubt / max(float(cover.sum(dtype=float)), _LEAST)


def _log_odds(shares: np.ndarray) -> np.ndarray:
    shares = np.clip(shares, _UNSURE, 1 - _UNSURE)
    return np.concatenate([[1.0], np.log(shares / (1 - shares))])
