"""The confidence of a mask.

Problem: a photo without one distinct object, or with one that the network cannot separate from its
surroundings, should be refused, not masked.

Equation: the log odds of a correct mask are w_0 + w_1 l(p_1) + w_2 l(p_2) + w_3 l(o) + w_4 l(f_1) +
w_5 l(f_2). l is the log odds of the probabilities p of one object in both passes, of the overlap o
of the passes, and of their decisiveness f = 1 - 2 (sum c (1 - c)) / (sum c) for the coverage c: 1
if every pixel is certain, 0 if all have even odds. w is fitted (`training.masks.mask_calibration`).

Citation: J. Platt, "Probabilistic outputs for support vector machines", 1999.

Limits: fitted to photos without hints. With hints, which both passes receive, the probability is
multiplied by the fraction of points that the mask satisfies; docs/methods/automatic_mask.md
reports how accurate it is then.
"""

import math

import numpy as np

from ..networks.mask_network import EVIDENCE, Count
from .frames import PartPrediction

_UNSURE = 1e-3
_LEAST = 1e-6
_OVERLAP = 3  # place of the overlap's log odds


def evidence_of(first: PartPrediction, second: PartPrediction, before: np.ndarray) -> np.ndarray:
    """Return what the confidence is computed from.

    Parameters
    ----------
    first, second : PartPrediction
        At the whole photo and at a part of it.
    before : (height, width) ndarray
        Coverage of that part in the first pass.

    Returns
    -------
    (EVIDENCE,) ndarray
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
    evidence : (EVIDENCE,) ndarray
        As `evidence_of`.
    looked, taken : (H, W) ndarray
        Covers: the network's, and that of the mask.

    Returns
    -------
    (EVIDENCE,) ndarray
        The overlap is that of both masks if it is less than that of the passes.
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
    (EVIDENCE,) ndarray
        As `evidence_of`.
    """
    found = np.zeros(EVIDENCE - 1)
    found[0] = first.counts[Count.ONE]
    return _log_odds(found)


def confidence_of(evidence: np.ndarray, weights: np.ndarray) -> float:
    """Return the probability that a mask is right.

    Parameters
    ----------
    evidence, weights : (EVIDENCE,) ndarray

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
