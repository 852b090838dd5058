"""The area under the ROC curve is the share of pairs in the right order."""

import math

import numpy as np
import pytest

from benchmarks.decomposition.assumption_checks import roc_area


def test_the_area_counts_pairs_in_the_right_order() -> None:
    rng = np.random.default_rng(0)
    scores, positive = rng.integers(0, 6, 40).astype(float), rng.random(40) < 0.4
    above = scores[positive][:, None] - scores[~positive]
    assert roc_area(list(scores), list(positive)) == pytest.approx(
        (above > 0).mean() + 0.5 * (above == 0).mean()
    )


def test_separable_reversed_and_equal_scores() -> None:
    positive = [False, False, True]
    assert roc_area([0.1, 0.2, 0.3], positive) == 1
    assert roc_area([0.3, 0.2, 0.1], positive) == 0
    assert roc_area([1.0, 1.0, 1.0], positive) == 0.5


def test_without_a_pair_there_is_no_area() -> None:
    assert math.isnan(roc_area([0.1, 0.2], [True, True]))
