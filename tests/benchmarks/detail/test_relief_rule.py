"""The rule that tells relief from paint: its fit on numbers whose answer is known."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.detail.relief_rule import left_out, relief_blocks, rule_weights
from benchmarks.detail.sets import Truth
from isc_core.decomposition.detail import Pyramid


def test_weights_of_a_known_boundary() -> None:
    rng = np.random.default_rng(0)
    features = rng.normal(size=(400, 2))
    is_relief = rng.random(400) < 1 / (1 + np.exp(-(0.5 + 2 * features[:, 0])))
    offset, first, second = rule_weights(features, is_relief, np.ones(400))
    assert abs(offset - 0.5) < 0.4 and abs(first - 2) < 0.5 and abs(second) < 0.4


def test_a_weight_of_two_is_the_same_block_twice() -> None:
    rng = np.random.default_rng(1)
    features, is_relief = rng.normal(size=(60, 2)), rng.random(60) < 0.5
    twice = np.arange(60) < 20
    weighted = rule_weights(features, is_relief, 1.0 + twice)
    again = np.concatenate([np.arange(60), np.flatnonzero(twice)])
    repeated = rule_weights(features[again], is_relief[again], np.ones(80))
    assert np.allclose(weighted, repeated)


def test_a_body_left_out_does_not_decide_about_itself() -> None:
    features = np.array([[0.0], [0.1], [1.0], [1.1], [0.05], [0.06]])
    is_relief = np.array([False, False, True, True, True, True])
    found = left_out(features, is_relief, np.full(6, 10.0), np.array([0, 0, 1, 1, 2, 2]))
    assert (found[4:] < 0.5).all()


def test_blocks_with_relief_are_where_normals_differ() -> None:
    mask = np.zeros((400, 400), bool)
    mask[20:380, 20:380] = True
    smooth = np.zeros((400, 400, 3), np.float32)
    smooth[mask] = (0, 0, 1)
    normal = smooth.copy()
    normal[20:380, 20:200] = np.array([np.sin(0.1), 0, np.cos(0.1)]) * mask[20:380, 20:200, None]
    pyramid = Pyramid.of(np.ones((400, 400, 3)), mask, np.zeros(mask.shape), np.zeros((9, 3)))
    found = relief_blocks(pyramid, Truth(normal, smooth, mask))
    side = 8 << pyramid.frame.halvings
    assert found.shape == tuple(n // side for n in pyramid.levels[0].mask.shape)
    middle = len(found) // 2
    assert found[middle, 3 : 3 + 130 // side].all()
    assert not found[middle, -3 - 130 // side :].any()
