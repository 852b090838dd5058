"""The confidence of a mask.

Problem: a photo without one distinct object, or with one that the network cannot separate from its
surroundings, should be refused, not masked.

Equation: logistic regression. The log odds of a correct mask are w_0 + w_1 l(p_1) + w_2 l(p_2) +
w_3 l(o) + w_4 l(f_1) + w_5 l(f_2). l(p) = log(p / (1 - p)). p_1 and p_2 are the probabilities of
one object in both passes; if the mask is in one piece, of one or several: objects that touch, or an
object of several paints. o is the overlap of the passes, and f is the decisiveness of a pass, 1 - 2
(sum c (1 - c)) / (sum c) for the coverage c: 1 if every pixel is certain, 0 if all have even odds.
w is fitted (`training.masks.mask_calibration`).

Citation: J. Platt, "Probabilistic outputs for support vector machines", 1999.

Limits: fitted to photos without hints. With hints, which both passes receive, the probability is
multiplied by the fraction of points that the mask satisfies; docs/methods/automatic_mask.md
reports how accurate it is then.
"""

import math

import numpy as np

from ..networks.mask_network import FEATURES, Count
from .crops import CropPrediction

_MIN_PROBABILITY = 1e-3  # smaller ones, and those of the complement, are clipped
_EPSILON = 1e-6
_OVERLAP = 3  # index of the overlap among the features


def confidence_features(
    first: CropPrediction, second: CropPrediction, before: np.ndarray, in_one_piece: bool
) -> np.ndarray:
    """Return the features of the confidence.

    Parameters
    ----------
    first, second : CropPrediction
        Of the whole photo, and of a crop.
    before : (height, width) ndarray
        Coverage of that crop in the first pass.
    in_one_piece : bool
        Whether the mask is.

    Returns
    -------
    (FEATURES,) ndarray
        1, and log odds.
    """
    counts = [Count.ONE, Count.SEVERAL] if in_one_piece else [Count.ONE]
    probabilities = [
        float(first.counts[counts].sum()),
        float(second.counts[counts].sum()),
        mask_overlap(before, second.cover),
        _decisiveness(first.cover),
        _decisiveness(second.cover),
    ]
    return _features(np.array(probabilities))


def features_of_replacement(
    features: np.ndarray, predicted: np.ndarray, replacement: np.ndarray
) -> np.ndarray:
    """Return the features of a mask that replaces the network's.

    Parameters
    ----------
    features : (FEATURES,) ndarray
        Those of the network's mask.
    predicted, replacement : (H, W) ndarray
        Coverage: the network's, and that of the mask that replaces it.

    Returns
    -------
    (FEATURES,) ndarray
        The overlap is that of both masks if it is less than that of the passes.
    """
    overlap = _features(np.array([mask_overlap(predicted, replacement)]))[1]
    changed = features.copy()
    changed[_OVERLAP] = min(changed[_OVERLAP], overlap)
    return changed


def features_without_object(first: CropPrediction) -> np.ndarray:
    """Return the features of a photo in which no object is found.

    Parameters
    ----------
    first : CropPrediction
        Of the whole photo.

    Returns
    -------
    (FEATURES,) ndarray
        1, and log odds.
    """
    probabilities = np.zeros(FEATURES - 1)
    probabilities[0] = first.counts[Count.ONE]
    return _features(probabilities)


def confidence_of(features: np.ndarray, weights: np.ndarray) -> float:
    """Return the probability that a mask is correct.

    Parameters
    ----------
    features, weights : (FEATURES,) ndarray

    Returns
    -------
    float
    """
    return 1 / (1 + math.exp(-float((weights * features).sum())))


def mask_overlap(one: np.ndarray, other: np.ndarray) -> float:
    """Return the intersection over union of two masks or coverages.

    Parameters
    ----------
    one, other : (H, W) bool or float32 ndarray

    Returns
    -------
    float
        In [0, 1]; 0 if both are empty.
    """
    intersection, union = (
        float(join(one, other).sum(dtype=float)) for join in (np.minimum, np.maximum)
    )
    return intersection / max(union, _EPSILON)


def _decisiveness(cover: np.ndarray) -> float:
    uncertainty = float((cover * (1 - cover)).sum(dtype=float))
    return 1 - 2 * uncertainty / max(float(cover.sum(dtype=float)), _EPSILON)


def _features(probabilities: np.ndarray) -> np.ndarray:
    """1, and the log odds of probabilities."""
    clipped = np.clip(probabilities, _MIN_PROBABILITY, 1 - _MIN_PROBABILITY)
    return np.concatenate([[1.0], np.log(clipped / (1 - clipped))])
