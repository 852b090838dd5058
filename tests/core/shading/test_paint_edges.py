"""Edges of paint, and edges that are not paint."""

import numpy as np
import pytest

from isc_core.shading.paint_edges import paint_features, paint_guide, uniformity

SIDE = 48
MASK = np.ones((SIDE, SIDE), bool)
LEFT = np.arange(SIDE) < SIDE // 2


def _uniform(
    left: tuple[float, ...], right: tuple[float, ...], mask: np.ndarray = MASK
) -> np.ndarray:
    """Uniformity of an image of two colours beside each other."""
    image = np.where(LEFT[:, None], left, right).astype(np.float32)
    image = np.broadcast_to(image / image.mean(), (SIDE, SIDE, 3)) * mask[..., None]
    contrast = np.log(image.mean(axis=2) + 0.01)
    return uniformity(paint_guide(image, mask, contrast), mask)


def test_an_edge_of_colour_is_found_where_it_is() -> None:
    found = _uniform((0.6, 0.2, 0.2), (0.2, 0.4, 0.2))
    edge = slice(SIDE // 2 - 1, SIDE // 2 + 1)
    assert found[:, edge].max() < 0.01
    assert found[:, : SIDE // 2 - 4].min() > 0.99 < found[:, SIDE // 2 + 4 :].min()


def test_black_on_white_is_an_edge_and_a_fold_is_none() -> None:
    print_, fold = _uniform((0.9,) * 3, (0.05,) * 3), _uniform((0.5,) * 3, (0.42,) * 3)
    assert print_.min() < 0.01 and fold.min() > 0.95


def test_exposure_changes_nothing() -> None:
    image = np.random.default_rng(0).uniform(0.2, 0.8, (SIDE, SIDE, 3)).astype(np.float32)
    maps = [
        uniformity(paint_guide(image, MASK, np.full((SIDE, SIDE), level, np.float32)), MASK)
        for level in (0.0, 0.7)
    ]
    assert maps[0] == pytest.approx(maps[1], abs=1e-5)


def test_the_outline_is_no_edge() -> None:
    mask = np.zeros_like(MASK)
    mask[10:-10, 10:-10] = True
    assert _uniform((0.5, 0.3, 0.2), (0.5, 0.3, 0.2), mask).min() > 0.99


def test_far_colours_count_no_more_than_strong_ones() -> None:
    far = paint_features(np.full((3, SIDE, SIDE), 9.0, np.float32), MASK)
    assert far[..., :2] == pytest.approx(2) and far[..., 2] == pytest.approx(0.4)
    outside = paint_features(np.ones((3, SIDE, SIDE), np.float32), np.zeros_like(MASK))
    assert not outside.any()
