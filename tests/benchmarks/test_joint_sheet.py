"""The sheet of the joint model: its errors and its layout."""

import numpy as np
import pytest

from benchmarks.decomposition.joint_sheet import error_ratio, sheet


def test_the_error_is_relative_to_that_of_the_photo() -> None:
    true, highlight = np.full((5, 3), 0.3), np.full((5, 3), 0.4)
    photo = true + highlight
    assert error_ratio(photo, photo, true) == 1
    assert error_ratio(true, photo, true) == 0
    assert error_ratio(true + highlight / 2, photo, true) == pytest.approx(0.25)


def test_layers_stand_beside_each_other_in_one_exposure() -> None:
    mask = np.zeros((40, 30), bool)
    mask[5:25, 10:20] = True
    dark, bright = (np.full((40, 30, 3), value) for value in (0.2, 0.8))
    pixels = np.asarray(sheet((dark, bright), mask, 0.8))
    height, width = pixels.shape[:2]
    assert height % 20 == 0 and pixels[0, width // 2].tolist() == [255] * 3, "a gap between them"
    assert pixels[height // 2, 0, 0] < 150 and pixels[height // 2, -1, 0] == 255
