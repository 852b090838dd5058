"""Evidence of relief, for each paint of an object."""

import numpy as np
import pytest

from isc_core.shading.relief_evidence import (
    BLOCK,
    RULE,
    Evidence,
    added_share,
    block_moments,
    paint_evidence,
)

SIDE = 128
MASK = np.ones((SIDE, SIDE), bool)
ONE_PAINT = np.zeros((SIDE, SIDE, 3), np.float32)
EVERYWHERE = np.ones((SIDE, SIDE))


def _gain() -> tuple[np.ndarray, np.ndarray]:
    """Shading that changes with the slope, more below, in directions that vary."""
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    size = 0.1 + 0.9 * y
    return size * np.cos(x), size * np.sin(x)


def _texture(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(SIDE, SIDE)) * 0.05


def _relief(seed: int) -> np.ndarray:
    down, right = np.gradient(_texture(seed))
    gain = _gain()
    return np.exp(gain[0] * right + gain[1] * down)


def _grey(light: np.ndarray) -> np.ndarray:
    return np.tile(light[..., None], 3)


def _found(light: np.ndarray, guide: np.ndarray = ONE_PAINT) -> Evidence:
    moments = block_moments(_grey(light), MASK, _gain(), EVERYWHERE)
    found = paint_evidence([moments], guide, MASK)
    assert found is not None
    return found


def test_relief_and_paint_of_the_same_texture_are_told_apart() -> None:
    relief, paint = _found(_relief(0)), _found(np.exp(_texture(0)))
    assert relief.correlation.min() > 0.5 > np.abs(paint.correlation).max()
    assert relief.along.min() > 0.3 > np.abs(paint.along).max()
    assert RULE.probability(relief).min() > 0.75 > 0.3 > RULE.probability(paint).max()


def test_one_object_has_relief_in_one_paint_and_print_in_the_other() -> None:
    left = np.arange(SIDE) < SIDE // 2
    light = np.where(left, _relief(0), np.exp(_texture(1)))
    guide = ONE_PAINT + np.where(left, 0, 1)[:, None].astype(np.float32)
    share = added_share(RULE.probability(_found(light, guide)))
    half = SIDE // BLOCK // 2
    assert (share[:, :half] == 1).all()
    assert (share[:, half:] == 0).all()
    mixed = added_share(RULE.probability(_found(light)))
    assert np.ptp(mixed) < 1e-12  # one paint: one answer for all


def test_turning_the_photo_by_a_quarter_changes_nothing() -> None:
    gain, light = _gain(), _relief(1)
    right, down = (np.rot90(one) for one in gain)  # counterclockwise: right becomes up
    before = block_moments(_grey(light), MASK, gain, EVERYWHERE)
    after = block_moments(_grey(np.rot90(light)), MASK, (down, -right), EVERYWHERE)
    assert after == pytest.approx(np.rot90(before), abs=1e-9)


def test_small_objects_have_no_evidence_and_even_ones_no_relief() -> None:
    small = np.zeros_like(MASK)
    small[:16, :16] = True
    moments = block_moments(_grey(_relief(2)), small, _gain(), EVERYWHERE)
    assert paint_evidence([moments], ONE_PAINT, small) is None
    assert not added_share(RULE.probability(_found(np.ones((SIDE, SIDE))))).any()


def test_edges_of_paint_are_no_evidence() -> None:
    light, edge = _relief(3), np.zeros((SIDE, SIDE), bool)
    edge[:, 32:36] = True
    uniform = np.where(edge, 0.0, 1.0)
    moments = block_moments(_grey(light), MASK, _gain(), uniform)
    change = np.where(edge, 1.0005, 1) * light  # hardly moves the average beside the edge
    other = block_moments(_grey(change), MASK, _gain(), uniform)
    assert other == pytest.approx(moments, rel=0.02, abs=0.02)
    without = block_moments(_grey(light), MASK, _gain(), 0 * uniform)
    assert not without.any()


def test_finer_levels_are_averaged_over_the_same_blocks() -> None:
    moments = block_moments(_grey(_relief(4)), MASK, _gain(), EVERYWHERE)
    coarse = block_moments(_grey(_relief(4)), MASK, _gain(), EVERYWHERE, blocks=2)
    assert coarse.shape == (8, 8, 8)
    assert coarse[0, 0] == pytest.approx(moments[:2, :2].mean(axis=(0, 1)))


def test_the_share_grows_with_the_evidence_and_is_nothing_for_likely_paint() -> None:
    values = np.array([[-5, 0.0, 0.15, 0.2, 0.3, 5]])
    shares = added_share(RULE.probability(Evidence(values, values)))[0]
    assert list(shares) == sorted(shares) and shares[0] == shares[1] == 0 and shares[-1] == 1
    wanted = added_share(np.array([0.0, 0.3, 0.45, 0.6, 1.0]))
    assert wanted == pytest.approx([0, 0, 0.5, 1, 1])
