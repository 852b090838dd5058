"""Stretched bodies are those that a camera would see; stores give what batches give."""

import math

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from tests.training.world.analytic_views import ellipsoid_view
from training.world.view_batches import (
    ViewBatch,
    ViewStore,
    batch_of,
    padded_views,
    prepared,
    stretched,
)
from training.world.views import SIDE

HALVES = ((0.9, 0.9, 0.9), (0.5, 0.9, 0.7))
VIEWS = [prepared(ellipsoid_view(np.random.default_rng(k), half)) for k, half in enumerate(HALVES)]
FACTORS = torch.tensor([[1.2, 0.8, 0.6], [0.9, 1.1, 1.5]])


@pytest.fixture(scope="module")
def long() -> ViewBatch:
    return stretched(batch_of(VIEWS), FACTORS)


def on_body(views: ViewBatch) -> torch.Tensor:
    return views.index < SIDE * SIDE


def test_a_stretched_ellipsoid_is_an_ellipsoid(long: ViewBatch) -> None:
    for k, (half, factor) in enumerate(zip(HALVES, FACTORS, strict=True)):
        axes = torch.tensor(half) * factor
        seen = on_body(long)[k]
        place = long.position[k][seen]
        assert ((place / axes).norm(dim=-1) - 1).abs().max() < 0.02
        true = torch.nn.functional.normalize(place / axes**2, dim=-1)
        assert (true - long.normal[k][seen]).norm(dim=-1).quantile(0.99) < 0.03


def test_stretching_hides_nothing_and_shows_nothing(long: ViewBatch) -> None:
    before = batch_of(VIEWS).reached > 3
    assert not ((long.reached > 3) & (batch_of(VIEWS).reached == 0)).any()
    assert (long.reached[before] > 0).float().mean() > 0.999


def test_solid_angles_follow_the_directions(long: ViewBatch) -> None:
    """Uniform light gives a surface that faces the viewer the same irradiance."""
    step = 2 * math.pi * 1.5 / long.directions.shape[1]
    light = (long.directions[..., 2].clamp(min=0) * long.solid * step).sum(1)
    torch.testing.assert_close(light, torch.full((2,), math.pi), rtol=0.04, atol=0)


def test_no_stretch_changes_nothing() -> None:
    views = batch_of(VIEWS)
    same = stretched(views, torch.ones(2, 3))
    assert ((same.reached.int() - views.reached.int()).abs() <= 1).all()
    for name in ("normal", "position", "toward", "thickness", "directions", "solid"):
        torch.testing.assert_close(getattr(same, name), getattr(views, name))


def test_a_store_fills_up_as_batches_do() -> None:
    chosen = torch.tensor([1, 0, 1])
    batch = batch_of([VIEWS[k] for k in chosen])
    filled = padded_views([batch_of([VIEWS[k]]) for k in chosen])
    for store in (ViewStore(VIEWS).batch(chosen), filled):
        for name, part in vars(batch).items():
            torch.testing.assert_close(getattr(store, name), part)
    lengths = torch.tensor([len(VIEWS[k].index) for k in chosen])
    empty = torch.arange(int(lengths.max())) >= lengths[:, None]
    assert empty.any() and ((batch.index == SIDE * SIDE) == empty).all()
    for facing in (batch.normal[empty], batch.toward[empty]):
        assert (facing == torch.tensor([0.0, 0, 1])).all()
    assert not batch.position[empty].any() and not batch.reached[empty].any()
