"""Variation of objects and backgrounds: what changes and what does not."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from isc_core.networks.mask_network import SIDE
from training.masks.composites import CompositeDraws, Composites
from training.masks.scenes import draw_scenes
from training.masks.variation import (
    draw_background_variation,
    matched_colours,
    varied_backgrounds,
    varied_objects,
)

from .white_shapes import ingredients


def test_objects_are_stretched_and_keep_their_place() -> None:
    rng = np.random.default_rng(0)
    _, objects = draw_scenes(rng, 50, (0, 0, 1))
    varied, _ = varied_objects(objects, rng)
    assert torch.equal(varied.place, objects.place)
    assert float(varied.stretch.log().std()) == pytest.approx(0.15, abs=0.03)
    assert (varied.channels.sort(1).values == torch.arange(3)).all()
    permuted = (varied.channels != torch.arange(3)).any(1).float().mean()
    assert 0.15 < float(permuted) < 0.35  # one permutation in six is the identity
    assert float(varied.cutout.mean()) < 0.45 < float(objects.cutout.mean()), (
        "thin ones are more frequent"
    )


def test_variation_keeps_the_area_of_masks() -> None:
    draw = CompositeDraws(24, 0, (0, 1, 0), varied=True)
    compose = Composites(ingredients(), draw, SIDE)
    batch = draw(np.random.default_rng(1))
    plain = replace(
        batch,
        objects=replace(batch.objects, stretch=torch.ones(len(batch.objects))),
        object_variation=None,
        background_variation=None,
    )
    areas = [compose.composed(one).mask.flatten(1).sum(1).numpy() for one in (plain, batch)]
    ratio = areas[1] / areas[0]
    assert np.median(ratio) == pytest.approx(1, abs=0.05) and np.ptp(ratio) > 0.01


def test_varied_backgrounds_keep_their_brightness() -> None:
    light = torch.rand(40, 3, 16, 16, generator=torch.Generator().manual_seed(0)) + 0.1
    light = light * torch.tensor([0.2, 0.5, 1.0])[None, :, None, None]
    drawn = draw_background_variation(np.random.default_rng(0), 40)
    whole = replace(drawn, present=torch.zeros_like(drawn.present))
    varied = varied_backgrounds(light.clone(), whole)
    assert varied.shape == light.shape and bool((varied > 0).all())
    brightness = varied.mean((1, 2, 3)) / light.mean((1, 2, 3))
    assert float(brightness.min()) > 0.7 and float(brightness.max()) < 1.5
    order = varied.mean((2, 3)).argsort(1)
    kept = (order == torch.tensor([0, 1, 2])).all(1).float().mean()
    assert 0.5 < float(kept) < 0.95


def test_a_share_of_backgrounds_is_split_at_a_line() -> None:
    light = torch.ones(60, 3, 32, 32)
    drawn = draw_background_variation(np.random.default_rng(1), 60)
    varied = varied_backgrounds(light, drawn)
    split = varied.flatten(1).std(1) > 0.02
    assert not bool(split[~drawn.present[:, 0]].any())
    assert 0.15 < float(split.float().mean()) < 0.45


def test_matched_objects_have_the_colour_of_what_they_cover() -> None:
    rng = np.random.default_rng(0)
    _, objects = draw_scenes(rng, 40, (0, 1, 0))
    _, drawn = varied_objects(objects, rng)
    cover = torch.zeros(len(objects), 1, 16, 16)
    cover[:, :, 4:12, 4:12] = 1
    light = torch.tensor([0.2, 0.3, 0.4])[:, None, None].expand(len(objects), 3, 16, 16)
    foreground = 0.8 * cover.expand(-1, 3, -1, -1)
    found = matched_colours(foreground, cover, light, drawn)
    assert torch.equal(found[~drawn.matched], foreground[~drawn.matched])
    factor = found[drawn.matched][:, :, 8, 8] / torch.tensor([0.2, 0.3, 0.4])
    assert float(factor.log().abs().max()) < 0.9 and float(factor.log().mean()) < 0.2
