"""Hints lie on the object or on the background, as drawn."""

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from isc_core.networks.mask_network import POINT_RADIUS
from training.masks.hints import HintDraws, draw_hints, hint_maps, hinted

SIDE = 96


def maps(count: int, truth: torch.Tensor) -> tuple[torch.Tensor, HintDraws]:
    drawn = draw_hints(np.random.default_rng(0), count, 1.0, 4)
    inside = torch.ones(count, SIDE, SIDE, dtype=torch.bool)
    return hint_maps(truth.expand(count, SIDE, SIDE), inside, drawn), drawn


def test_points_and_boxes_lie_on_the_target_or_off_it_as_drawn() -> None:
    truth = torch.zeros(1, SIDE, SIDE, dtype=torch.bool)
    truth[:, 20:60, 30:80] = True
    found, drawn = maps(200, truth)
    # discs reach over the outline by their radius
    near = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    reach = int(POINT_RADIUS)
    near[20 - reach : 60 + reach, 30 - reach : 80 + reach] = True
    assert not bool(found[:, 0, ~near].any())
    assert not bool(found[:, 1, 20 + reach : 60 - reach, 30 + reach : 80 - reach].any())
    boxes = found[drawn.box, 2]
    inside = (boxes * truth).sum((1, 2)) / truth.sum()
    assert bool((inside > 0.8).all()) and bool((boxes.sum((1, 2)) < 2 * truth.sum()).all())
    assert not bool(found[~drawn.box, 2].any())
    assert 0.4 < float(drawn.box.float().mean()) < 0.6


def test_points_are_uniform_over_the_target() -> None:
    truth = torch.zeros(1, SIDE, SIDE, dtype=torch.bool)
    truth[:, :10, :10] = truth[:, -30:, -10:] = True
    found, _ = maps(600, truth)
    upper, lower = found[:, 0, :13, :13].sum(), found[:, 0, -33:, -13:].sum()
    assert 1.5 < float(lower / upper) < 4  # three times as many pixels


def test_hints_without_a_target_are_points_on_the_background() -> None:
    found, drawn = maps(100, torch.zeros(1, SIDE, SIDE, dtype=torch.bool))
    assert not bool(found[:, 2].any())
    pointed = (drawn.points[:, 0] < 1).any(1)
    assert torch.equal(found[:, 0].flatten(1).any(1), pointed)


def test_hints_select_one_visible_object() -> None:
    drawn = draw_hints(np.random.default_rng(1), 300, 1.0, 4)
    covers = torch.zeros(300, 3, 16, 16)
    covers[:, 0, :8], covers[:, 2, 8:] = 1, 1  # the second is hidden
    target = torch.tensor([True, False, False]).expand(300, 3)
    single = torch.ones(300, dtype=torch.bool)
    found = hinted(covers, target, single, drawn)
    assert torch.equal(found.any(1), ~drawn.background) and int(found.sum(1).max()) == 1
    assert not bool(found[:, 1].any())
    assert 0.65 < float(found[:, 0].float().mean()) < 0.85  # .94 (.6 + .4 / 2)
