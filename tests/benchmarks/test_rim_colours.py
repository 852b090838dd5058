"""The errors of rim colours."""

import numpy as np
import pytest

pytest.importorskip("torch")

from benchmarks.decomposition.rim_colours import rim_errors


def test_a_pure_photo_has_no_error_and_a_mixed_one_less_after_unmixing() -> None:
    y, x = np.mgrid[:64, :64] - 31.5
    cover = np.clip(0.5 + (20 - np.hypot(x, y)) / 3, 0, 1).astype(np.float32)
    front = np.full((64, 64, 3), (0.6, 0.3, 0.1), np.float32)
    mixed = cover[..., None] * front + (1 - cover[..., None]) * np.float32(0.9)
    pure = rim_errors((front, front, cover), (cover >= 0.5).astype(np.float32))
    np.testing.assert_array_equal(pure, 0)
    photo, unmixed, limited = rim_errors((mixed, front, cover), cover)
    assert (photo > unmixed).all() and (limited <= unmixed).all()
    assert photo[1] > photo[0] > 0
