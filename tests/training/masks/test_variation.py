"""Varied composites show the same scenes with other shapes and colours."""

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from isc_core.networks.mask_network import SIDE
from training.masks.composites import Composites
from training.masks.scenes import draw_scene
from training.masks.variation import varied_light, varied_scene

from .test_composites import ingredients


def test_things_are_stretched_and_keep_their_area() -> None:
    rng = np.random.default_rng(0)
    scene = draw_scene(rng, 5, (0, 0, 1))
    varied = varied_scene(scene, rng)
    assert [one.place.tolist() for one in varied.things] == [
        one.place.tolist() for one in scene.things
    ]
    stretches = np.array([one.stretch for one in varied.things])
    np.testing.assert_allclose(stretches.prod(axis=1), 1)
    assert np.ptp(stretches) > 0.05
    assert all(sorted(one.channels) == [0, 1, 2] for one in varied.things)


def test_masks_of_varied_composites_cover_as_much() -> None:
    areas = []
    for varied in (False, True):
        compose = Composites(ingredients(), 24, SIDE, 0, (0, 1, 0), varied)
        mask = compose(np.random.default_rng(1)).mask
        areas.append(mask.flatten(1).sum(1).numpy())
    ratio = areas[1] / areas[0]
    assert np.median(ratio) == pytest.approx(1, abs=0.05) and np.ptp(ratio) > 0.01


def test_backgrounds_keep_their_brightness_in_other_colours() -> None:
    light = torch.rand(40, 3, 16, 16, generator=torch.Generator().manual_seed(0)) + 0.1
    light = light * torch.tensor([0.2, 0.5, 1.0])[None, :, None, None]
    varied = varied_light(light.clone(), np.random.default_rng(0))
    assert varied.shape == light.shape and bool((varied > 0).all())
    brightness = varied.mean((1, 2, 3)) / light.mean((1, 2, 3))
    assert float(brightness.min()) > 0.7 and float(brightness.max()) < 1.5
    order = varied.mean((2, 3)).argsort(1)
    kept = (order == torch.tensor([0, 1, 2])).all(1).float().mean()
    assert 0.5 < float(kept) < 0.95
