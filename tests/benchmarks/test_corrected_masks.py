"""Points in the middle of the largest error, and the overlap that they achieve."""

import numpy as np
import pytest

pytest.importorskip("torch")

from benchmarks.decomposition.corrected_masks import correct, most_wrong_point
from tests.core.masking.ball_photos import TWO, balls


def square(*corners: tuple[int, int, int]) -> np.ndarray:
    """Squares (row, column, side)."""
    mask = np.zeros((60, 80), bool)
    for row, column, side in corners:
        mask[row : row + side, column : column + side] = True
    return mask


def test_the_point_is_in_the_middle_of_the_largest_error() -> None:
    truth = square((10, 10, 21))
    assert most_wrong_point(square(), truth) == ((20, 20), True)
    assert most_wrong_point(truth | square((40, 50, 11)), truth) == ((55, 45), False)
    assert most_wrong_point(truth, truth) is None


def test_points_select_one_of_two_balls() -> None:
    light, (left, _) = balls(TWO)
    overlaps = correct(light, left, 2)
    assert len(overlaps) == 3
    assert overlaps[-1] > 0.8 and overlaps[-1] >= overlaps[0]
