"""The fit of the rule of print, on regions of known weights, and the sets of bodies."""

import numpy as np
import pytest

pytest.importorskip("torch")

from benchmarks.separation.print_rule import Regions, cross_validated_losses, fitted, loss_line
from benchmarks.separation.print_set import Part, part_of
from isc_core.separation.support.highlight_evidence import WEIGHTS
from training.world.files import Split

_TRUE = np.array([0.5, 2.0, -1.0, 0.0])


def _photos(count: int) -> list[Regions]:
    """Photos of `count` bodies, two each, whose regions obey `_TRUE`."""
    rng = np.random.default_rng(0)
    found = []
    for k in range(2 * count):
        values = rng.normal(size=(4, 3))
        likely = 1 / (1 + np.exp(-_TRUE[0] - values @ _TRUE[1:]))
        gain = np.where(rng.random(4) < likely, 1.0, -1.0)
        found.append(Regions(f"body {k // 2}", values, np.ones(4), np.ones(4), gain, 1.0))
    return found


def test_the_fit_finds_the_weights_but_for_the_ridge() -> None:
    np.testing.assert_allclose(fitted(_photos(600)), _TRUE, atol=0.35)


def test_weights_of_the_regions_lose_less_than_others_on_bodies_not_fitted() -> None:
    losses = cross_validated_losses(_photos(100))
    assert losses.shape == (100, 2)
    new, shipped = losses.sum(axis=0)
    assert 0.2 < new < shipped
    assert f"fitted {new:.4f}, shipped {shipped:.4f}" in loss_line(losses)


def test_shipped_weights_equal_to_the_truth_are_not_beaten() -> None:
    rng = np.random.default_rng(1)
    photos = []
    for k in range(400):
        values = rng.normal(size=(3, 3))
        likely = 1 / (1 + np.exp(-WEIGHTS[0] - values @ WEIGHTS[1:]))
        gain = np.where(rng.random(3) < likely, 1.0, -1.0)
        photos.append(Regions(f"body {k}", values, np.ones(3), np.ones(3), gain, 1.0))
    new, shipped = cross_validated_losses(photos).sum(axis=0)
    assert abs(new - shipped) < 0.03


def test_no_body_is_fitted_that_a_network_has_learned_from() -> None:
    assert part_of("built/rock/0449", Split.TRAIN) is None
    assert part_of("built/rock/0450", Split.TRAIN) == Part.TRAINING
    assert part_of("family/lathe/0099", Split.TRAIN) is None
    assert part_of("family/lathe/0100", Split.UNSEEN_BODY) == Part.TRAINING
    assert part_of("furniture/x/0500", Split.TRAIN) is None
    held = {part_of(f"furniture/{k}", Split.UNSEEN_BODY) for k in range(40)}
    assert held == {Part.VALIDATION, Part.TEST}


def test_parts_of_one_piece_of_furniture_are_in_one_set() -> None:
    for piece in range(8):
        names = [f"furniture/{piece}-{k}" for k in range(12)]
        assert len({part_of(name, Split.UNSEEN_BODY) for name in names}) == 1
