"""Evidence of relief over a whole object."""

import numpy as np
import pytest

from isc_core.shading.relief_evidence import (
    RULE,
    Evidence,
    added_share,
    evidence_of,
    mean_evidence,
)

SIDE = 128
MASK = np.ones((SIDE, SIDE), bool)


def _gain() -> tuple[np.ndarray, np.ndarray]:
    """Shading that changes with the slope, more on the right, in directions that vary."""
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    size = 0.1 + 0.9 * x
    return size * np.cos(y), size * np.sin(y)


def _texture(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(SIDE, SIDE)) * 0.05


def test_relief_and_paint_of_the_same_texture_are_told_apart() -> None:
    gain = _gain()
    down, right = np.gradient(_texture(0))
    relief = np.exp(gain[0] * right + gain[1] * down)
    paint = np.exp(_texture(0))
    found = [evidence_of(np.tile(one[..., None], 3), MASK, gain) for one in (relief, paint)]
    assert found[0] is not None and found[1] is not None
    assert found[0].correlation > 0.5 > abs(found[1].correlation)
    assert found[0].along > 0.3 > abs(found[1].along)
    assert RULE.probability(found[0]) > 0.75 > RULE.probability(found[1])


def test_turning_the_photo_by_a_quarter_changes_nothing() -> None:
    gain, image = _gain(), np.tile(np.exp(_texture(1))[..., None], 3)
    right, down = (np.rot90(one) for one in gain)  # counterclockwise: right becomes up
    turned = (down, -right)
    before = evidence_of(image, MASK, gain)
    after = evidence_of(np.rot90(image), MASK, turned)
    assert before is not None and after is not None
    assert after.correlation == pytest.approx(before.correlation, abs=1e-6)
    assert after.along == pytest.approx(before.along, abs=1e-6)


def test_small_and_even_objects_say_nothing() -> None:
    image = np.tile(np.exp(_texture(2))[..., None], 3)
    small = np.zeros_like(MASK)
    small[:16, :16] = True
    assert evidence_of(image, small, _gain()) is None
    assert evidence_of(np.ones_like(image), MASK, _gain()) is None
    assert mean_evidence([None, None]) is None
    assert RULE.share(None) == 0


def test_levels_are_averaged() -> None:
    one, other = Evidence(0.2, 1.0), Evidence(0.4, -1.0)
    mean = mean_evidence([one, None, other])
    assert mean is not None and mean.correlation == pytest.approx(0.3) and mean.along == 0


def test_the_share_grows_with_the_evidence_and_is_nothing_for_likely_paint() -> None:
    shares = [RULE.share(Evidence(c, c)) for c in (-5, 0.0, 0.3, 0.5, 0.8, 5)]
    assert shares == sorted(shares) and shares[0] == shares[1] == 0 and shares[-1] == 1
    assert [added_share(p) for p in (0.0, 0.3, 0.45, 0.6, 1.0)] == pytest.approx([0, 0, 0.5, 1, 1])
