"""Small highlights lie where the law of reflection puts them, and add nothing elsewhere."""

from dataclasses import replace

import pytest

pytest.importorskip("torch")

import torch

from training.world import small_highlights as module
from training.world.lit_pictures import LitPictures
from training.world.small_highlights import small_highlights

SIDE, COUNT = 64, 40


def spheres() -> LitPictures:
    """Spheres under one lamp, whose mean shading is 2."""
    x, y = torch.meshgrid(*[torch.linspace(-1.1, 1.1, SIDE)] * 2, indexing="xy")
    squared = 1 - x**2 - y**2
    cover = (squared > 0).float()
    normal = torch.stack([x, -y, squared.clamp(min=0).sqrt()]) * cover
    layers = torch.zeros(COUNT, 13, SIDE, SIDE)
    layers[:, 6:9] = 2 * cover
    layers[:, 9:12] = normal
    blank = {name: torch.zeros(COUNT) for name in LitPictures.__dataclass_fields__}
    lamp = torch.nn.functional.normalize(torch.tensor([0.5, 0.6, 0.4]), dim=0)
    return replace(
        LitPictures(**blank),
        layers=layers.half(),
        cover=cover.expand(COUNT, 1, SIDE, SIDE),
        lamps=torch.ones(COUNT, dtype=torch.int64),
        strongest=lamp.expand(COUNT, 3),
    )


def test_a_lamp_is_mirrored_half_way_between_it_and_the_viewer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_MOST", 1)
    monkeypatch.setattr(module, "_KNOWN", 1.0)
    monkeypatch.setattr(module, "_WINDOW", 0.0)
    torch.manual_seed(0)
    pictures = spheres()
    found = small_highlights(pictures)
    middle = torch.nn.functional.normalize(pictures.strongest[0] + torch.tensor([0.0, 0, 1]), dim=0)
    brightest = found.sum(1).flatten(1).argmax(1)
    normal = pictures.layers[0, 9:12].flatten(1)[:, brightest].float()
    assert (middle @ normal > 0.998).all()


def test_highlights_are_small_near_white_and_on_the_body() -> None:
    torch.manual_seed(1)
    pictures = spheres()
    found = small_highlights(pictures)
    cover = pictures.cover
    assert (found >= 0).all() and not (found * (1 - cover)).any()
    peak = found.amax((1, 2, 3), keepdim=True)
    bright = (found > peak / 2).any(1, keepdim=True).float().sum((1, 2, 3)) / cover[0].sum()
    assert bright.median() < 0.08
    colour = found.sum((2, 3))
    assert (colour.amax(1) / colour.amin(1)).max() < 1.8


def test_they_are_as_bright_as_the_shading() -> None:
    torch.manual_seed(2)
    once = small_highlights(spheres())
    torch.manual_seed(2)
    pictures = spheres()
    layers = pictures.layers.clone()
    layers[:, 6:9] *= 3
    torch.testing.assert_close(small_highlights(replace(pictures, layers=layers)), 3 * once)
