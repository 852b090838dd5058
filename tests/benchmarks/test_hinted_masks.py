"""The benchmark of masks from hints: hints lie where a user puts them, sure and right are apart."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs the extra `training`")

from benchmarks.decomposition.hinted_masks import KINDS, MaskScore, drawn_hints, report


def test_hints_lie_on_the_object_and_beside_it() -> None:
    truth = np.zeros((60, 80), bool)
    truth[20:40, 30:60] = True
    rng = np.random.default_rng(0)
    for kind in KINDS * 10:
        hints = drawn_hints(truth, kind, rng)
        hints.check(80, 60)
        assert all(truth[y, x] for x, y in hints.points)
        assert not any(truth[y, x] for x, y in hints.background)
        assert bool(hints.background) is (kind == "points and not")
        if hints.box is not None:
            x, y, width, height = hints.box
            outside = truth.copy()
            outside[y : y + height, x : x + width] = False
            assert not outside.any() and width * height < 2 * truth.sum()


def test_the_table_sorts_by_kind_and_by_confidence() -> None:
    found = [("box", 0.9, 0.99), ("points", 0.2, 0.3), ("points and not", 0.8, 0.6)]
    text = report([MaskScore(*one) for one in found])
    assert "| box | 1 | 0.900 | 0.900 | 100.0% (100-100) | 99.0% |" in text
    assert "| 0% to 50% | 1 | 30.0% | 0.0% (0-0) |" in text
    assert "| 50% to 80% | 1 | 60.0% | 100.0% (100-100) |" in text
