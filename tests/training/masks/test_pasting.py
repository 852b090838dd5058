"""Places, sizes, light and shadows of pasted objects."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from training.masks.ingredients import LENGTH, SIDE
from training.masks.pasting import CutOuts, shadows
from training.masks.scenes import PastedObjects, draw_scenes

from .white_shapes import ingredients

FRAME = 96
DISC, BAR = 0.9, 0.1  # thin cut-outs come first


def objects(number: int, cutout: float) -> PastedObjects:
    """One upright object per photo, in the middle, not varied."""
    _, found = draw_scenes(np.random.default_rng(0), 40 * number, (0, 1, 0))
    some = found.chosen(torch.nonzero(found.target)[:number, 0])
    same = torch.ones(number)
    return replace(
        some, cutout=cutout * same, angle=0 * same, mirror=same, place=torch.zeros(number, 2)
    )


def placed(some: PastedObjects) -> tuple[torch.Tensor, torch.Tensor]:
    pyramids = CutOuts(torch.from_numpy(ingredients().cutouts))
    levels = pyramids.levels(some.length * (FRAME / SIDE / LENGTH))
    groups = {int(k): torch.nonzero(levels == k)[:, 0] for k in levels.unique()}
    return pyramids.placed(some, groups, FRAME)


def test_objects_have_their_place_and_length() -> None:
    lengths = torch.tensor([24.0, 48, 90])  # of a frame of SIDE, one from each level
    some = replace(objects(3, DISC), length=lengths, place=torch.tensor([[0.2, -0.1]] * 3))
    _, cover = placed(some)
    across = (torch.arange(FRAME) + 0.5) * (2 / FRAME) - 1
    area = cover.sum((1, 2, 3))
    assert torch.allclose((cover.sum(2)[:, 0] * across).sum(1) / area, some.place[:, 0], atol=0.01)
    assert torch.allclose((cover.sum(3)[:, 0] * across).sum(1) / area, some.place[:, 1], atol=0.01)
    radius = lengths / 2 * FRAME / SIDE
    assert torch.allclose(area, torch.pi * radius.square(), rtol=0.02)


def test_objects_are_rotated_and_stretched() -> None:
    rotated = replace(objects(2, BAR), length=torch.full((2,), 60.0))
    rotated = replace(
        rotated, angle=torch.tensor([0, torch.pi / 2]), stretch=torch.tensor([1.0, 1.3])
    )
    _, cover = placed(rotated)
    wide, high = ((cover[:, 0].amax(axis) > 0.5).sum(1).float() for axis in (1, 2))
    length = 60 * FRAME / SIDE
    assert torch.allclose(wide, torch.tensor([length, length / 3 / 1.3]), atol=1.5)
    assert torch.allclose(high, torch.tensor([length / 3, length * 1.3]), atol=1.5)


def test_objects_have_their_mean_light() -> None:
    some = objects(4, DISC)
    foreground, cover = placed(some)
    light = foreground.sum((2, 3)) / cover.sum((2, 3))
    assert torch.allclose(light, some.gain, rtol=0.02)


def test_cast_shadows_follow_the_shear() -> None:
    some = replace(
        objects(2, DISC),
        length=torch.full((2,), 40.0),
        shear=torch.tensor([[1.0, 0.5], [1.0, 0.5]]),
        strength=torch.tensor([[0.8, 0.0], [0.0, 0.0]]),
        blur=torch.tensor([0, 3]),
    )
    _, cover = placed(some)
    shade = shadows(cover, some)
    assert not bool(shade[1].any()) and float(shade[0].max()) == pytest.approx(0.8, abs=0.02)
    across = (torch.arange(FRAME) + 0.5) * (2 / FRAME) - 1
    low = across[cover[0, 0].amax(1) > 0.5].max()
    # a point at height h above the lowest row casts its shadow at (h, low + h / 2); the lowest row
    # is known to two pixels
    total = shade[0, 0].sum()
    height = float((shade[0, 0].sum(0) * across).sum() / total)
    middle = float((shade[0, 0].sum(1) * across).sum() / total)
    assert height == pytest.approx(40 / SIDE, abs=0.06)
    assert middle - height / 2 == pytest.approx(float(low), abs=0.05)
