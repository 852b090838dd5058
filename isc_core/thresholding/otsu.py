"""Multilevel Otsu thresholds: the between-class variance, and its exact maximum (Otsu 1979).

Problem: K thresholds t_1 <= ... <= t_K split the levels 0..255 of an image into K + 1 classes,
class 0 being all levels <= t_1. Find the thresholds that maximise the separation of the classes.

Equation: with w_k the share of pixels in class k and m_k its mean, maximise sum_k w_k (m_k - m)^2.
Each class contributes a term that depends only on its two ends, so the objective is a sum of
entries of a table of 257 x 257 terms, and dynamic programming over the ends of the classes finds
the maximum: best_k(b) = max_a best_{k-1}(a) + term(a, b).

Citation: N. Otsu, "A threshold selection method from gray-level histograms", IEEE Trans. Systems,
Man, and Cybernetics 9(1), 62-66 (1979), doi:10.1109/TSMC.1979.4310076. P.-S. Liao, T.-S. Chen and
P.-C. Chung, "A fast algorithm for multilevel thresholding", Journal of Information Science and
Engineering 17(5), 713-727 (2001) (the table of terms).

Limits: where levels are empty, several sets of thresholds attain the maximum; the exact search
returns the lowest. The objective ignores the positions of pixels. A few bright pixels hardly affect
thresholds: a class of 1 % of the pixels has a weight of 1 %.
"""

import numpy as np

from ..errors import InputError
from .optimum import Optimum

LEVELS = 256


def quantise(values: np.ndarray, peak: float) -> np.ndarray:
    """Quantise values to levels 0..255: `values` / `peak` * 255, rounded and clamped.

    Parameters
    ----------
    values : ndarray
    peak : float

    Returns
    -------
    uint8 ndarray

    Raises
    ------
    InputError
        If the peak is not positive or a value is not finite.
    """
    if not (peak > 0 and np.isfinite(peak) and np.isfinite(values).all()):
        raise InputError(
            "thresholds need finite values and a peak above 0: check that the photo is not black "
            "or damaged"
        )
    return np.clip(
        np.rint(np.asarray(values, np.float64) * ((LEVELS - 1) / peak)), 0, LEVELS - 1
    ).astype(np.uint8)


class OtsuObjective:
    """The between-class variance of one histogram, in squared levels, for many candidates at once.

    `evaluations` counts the candidates; nothing is cached.
    """

    def __init__(self, counts: np.ndarray) -> None:
        """`counts` (256,): number of pixels of each level, or any weights >= 0.

        Raises `InputError` if they are invalid or all zero.
        """
        counts = np.asarray(counts, np.float64)
        if (
            counts.shape != (LEVELS,)
            or not np.isfinite(counts).all()
            or counts.min() < 0
            or counts.sum() <= 0
        ):
            raise InputError(
                f"a histogram needs {LEVELS} finite counts >= 0 that are not all zero: check that "
                "the mask is not empty"
            )
        share = counts / counts.sum()
        self.counts = counts
        self.evaluations = 0
        self.terms = _class_terms(share)

    @classmethod
    def of(cls, levels: np.ndarray) -> "OtsuObjective":
        """Return the objective of an image's levels.

        Parameters
        ----------
        levels : int ndarray
            From 0 to 255, see `quantise`; not empty.

        Returns
        -------
        OtsuObjective

        Raises
        ------
        InputError
            If the levels are not integers from 0 to 255, or there are none.
        """
        if (
            not np.issubdtype(np.asarray(levels).dtype, np.integer)
            or np.size(levels) == 0
            or np.min(levels) < 0
            or np.max(levels) >= LEVELS
        ):
            raise InputError(
                f"levels must be integers from 0 to {LEVELS - 1}, at least one: quantise the "
                "values first"
            )
        return cls(np.bincount(np.ravel(levels), minlength=LEVELS))

    def __call__(self, thresholds: np.ndarray) -> np.ndarray:
        """Values (n,) >= 0 of the rows of `thresholds` (n, K): integers 0..255, ascending in each
        row.
        """
        self.evaluations += len(thresholds)
        rows, count = thresholds.shape
        ends = np.zeros((rows, count + 2), np.intp)
        ends[:, 1:-1], ends[:, -1] = thresholds + 1, LEVELS
        return self.terms[ends[:, :-1], ends[:, 1:]].sum(axis=1)


def exact(objective: OtsuObjective, count: int) -> Optimum:
    """Compute the maximum by dynamic programming; of several, the lowest thresholds.

    Parameters
    ----------
    objective : OtsuObjective
    count : int
        At least 1.

    Returns
    -------
    Optimum
    """
    best = objective.terms[0].copy()  # for the first class only, by its end
    best[0] = -np.inf  # the first class contains at least level 0
    choices = []
    for _ in range(count):
        total = best[:, None] + objective.terms
        choices.append(np.argmax(total, axis=0))
        best = np.max(total, axis=0)
    end = LEVELS
    reversed_thresholds = []
    for starts in reversed(choices):
        end = int(starts[end])
        reversed_thresholds.append(end - 1)
    thresholds = np.array(reversed_thresholds[::-1])
    value = float(objective(thresholds[None])[0])
    return Optimum(thresholds, value, 1, np.array([[1, value]]))


def _class_terms(share: np.ndarray) -> np.ndarray:
    """Terms (257, 257): the contribution of a class of the levels a..b-1 at [a, b]; minus infinity
    for b < a, 0 for classes without pixels.
    """
    levels = np.arange(LEVELS) - share @ np.arange(LEVELS)  # about the mean, to avoid cancellation
    weight = np.concatenate([[0.0], np.cumsum(share)])
    moment = np.concatenate([[0.0], np.cumsum(share * levels)])
    weights = weight[None, :] - weight[:, None]
    moments = moment[None, :] - moment[:, None]
    filled = weights > 1e-15
    terms = np.where(filled, moments**2 / np.where(filled, weights, 1), 0.0)
    terms[np.tri(LEVELS + 1, k=-1, dtype=bool)] = -np.inf
    return terms
