"""Batches of photos: views are lit for some of them, photos are taken for all."""

import numpy as np
import pytest

pytest.importorskip("torch")

from tests.training.world.analytic_views import ellipsoid_view
from tests.training.world.test_recipes import ATLAS, bank
from training.networks.scene_batches import SceneBatches, SceneDraws
from training.world.recipes import Shares
from training.world.view_batches import prepared

VIEWS = [prepared(ellipsoid_view(np.random.default_rng(k), (0.9, 0.8, 0.7))) for k in range(2)]
SIZE, PHOTOS = 4, 2


@pytest.mark.parametrize("every", [1, 3])
def test_views_are_lit_for_one_batch_in_so_many(every: int) -> None:
    draw = SceneDraws(
        VIEWS, ATLAS, np.arange(3), SIZE, Shares(stretch=0.2), photos=PHOTOS, every=every
    )
    rng = np.random.default_rng(0)
    draws = [draw(rng) for _ in range(2 * every)]
    fresh = SIZE * every // PHOTOS
    assert [len(one.chosen) for one in draws] == 2 * [fresh, *(every - 1) * [0]]
    batches = SceneBatches(draw, bank(), 32)
    for one in draws:
        sample = batches.finished(one)
        assert len(sample) == SIZE and sample.photo.isfinite().all()
