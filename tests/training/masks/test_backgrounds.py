"""Backgrounds show panoramas, plain backdrops and tables."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from training.masks.backgrounds import BackgroundDraws, Backgrounds, draw_backgrounds

SIDE, ROWS = 48, 64


def render(drawn: BackgroundDraws, panorama: np.ndarray, pattern: int = 0) -> torch.Tensor:
    patterns = torch.full((2, 16, 16), pattern, dtype=torch.uint8)
    return Backgrounds(torch.from_numpy(panorama)[None].half(), patterns)(drawn, SIDE)


def test_a_crop_shows_the_directions_of_its_camera() -> None:
    # radiance is the height of the direction: the middle of a level camera sees the horizon
    height = np.cos((np.arange(ROWS) + 0.5) * (np.pi / ROWS))
    panorama = np.broadcast_to((height + 2)[:, None, None], (ROWS, 2 * ROWS, 3))
    drawn = draw_backgrounds(np.random.default_rng(0), 6, (0, 0))
    level = torch.eye(3).expand(6, 3, 3)
    window = torch.tensor([[1.0, 1.0], [0, 0]]).expand(6, 2, 2)
    crops = replace(drawn.crops, rotation=level, exposure=torch.full((6,), 0.3))
    light = render(replace(drawn, window=window, crops=crops), panorama.copy())
    across = (torch.arange(SIDE) + 0.5) * (2 / SIDE) - 1
    for half, photo in zip(drawn.crops.half, light, strict=True):
        column = photo[0, :, SIDE // 2]
        up = -across * half / (1 + (across * half).square()).sqrt()
        ratio = column / (up + 2)
        assert float(ratio.std() / ratio.mean()) < 0.01


def test_a_crop_has_its_exposure() -> None:
    panorama = np.random.default_rng(0).random((ROWS, 2 * ROWS, 3)) + 0.5
    drawn = draw_backgrounds(np.random.default_rng(1), 8, (0, 0))
    light = render(drawn, panorama)
    darker = (light.amax(1).flatten(1) < drawn.crops.exposure[:, None]).float().mean(1)
    assert float((darker - drawn.crops.quantile).abs().max()) < 0.08


def test_backdrops_have_one_chromaticity() -> None:
    drawn = draw_backgrounds(np.random.default_rng(2), 20, (1, 0))
    assert len(drawn.backdrops) == 20 and not len(drawn.crops) and not len(drawn.tables)
    dim = replace(drawn.backdrops, colour=0.05 * torch.rand(20, 3) + 0.01)
    light = render(replace(drawn, backdrops=dim), np.zeros((ROWS, 2 * ROWS, 3)))
    tint = light / light.mean(1, keepdim=True)
    assert float(tint.flatten(2).std(2).max()) < 1e-3 and float(light.flatten(1).std(1).min()) > 0


def test_tables_lie_below_their_edge() -> None:
    drawn = draw_backgrounds(np.random.default_rng(3), 30, (0, 1))
    tables = replace(drawn.tables, tilt=torch.zeros(30))
    window = torch.tensor([[1.0, 1.0], [0, 0]]).expand(30, 2, 2)
    light = render(replace(drawn, window=window, tables=tables), np.zeros((ROWS, 2 * ROWS, 3)))
    across = (torch.arange(SIDE) + 0.5) * (2 / SIDE) - 1
    seen = light.amax((1, 3)) > 0
    assert torch.equal(seen, across > tables.edge[:, None])
    again = render(replace(drawn, window=window, tables=tables), np.zeros((ROWS, 2 * ROWS, 3)), 255)
    first, second = (tables.first[:, 0], tables.second[:, 0])
    ratio = (again[:, 0, -1, 24] / light[:, 0, -1, 24]).log()
    known = (light[:, 0, -1, 24] < 1) & (again[:, 0, -1, 24] < 1) & seen[:, -1]
    assert int(known.sum()) > 10
    assert torch.allclose(ratio[known], (second / first).log()[known], atol=1e-3)
