"""Surfaces that consist of parts, and print of them."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.detail.part_maps import PartKind, draw_parts
from benchmarks.detail.part_prints import PartPrint, draw_part_print, varied_paint

SIDE = 128


@pytest.mark.parametrize("kind", list(PartKind))
def test_parts_have_steep_sides_and_shade_what_is_between_them(kind: PartKind) -> None:
    found = draw_parts(kind, np.random.default_rng(2), SIDE)
    steepness = np.sqrt((found.slope**2).sum(0).mean())
    assert 0.3 < steepness < 3
    assert len(np.unique(found.part)) > 10
    assert ((found.visible > 0.05) & (found.visible <= 1)).all()
    below = found.height < np.quantile(found.height, 0.1)
    assert found.visible[below].mean() < found.visible[~below].mean() - 0.05
    # A map that tiles has no slope on average.
    assert np.abs(found.slope.sum(axis=(1, 2))).max() < 1e-9 * found.slope.size


@pytest.mark.parametrize("number", range(len(PartPrint)))
def test_print_of_parts_is_a_reflectance(number: int) -> None:
    rng = np.random.default_rng(number)
    parts = draw_parts(PartKind.SCALES, rng, SIDE)
    paint, style = draw_part_print(parts, number, rng)
    assert style == list(PartPrint)[number]
    assert paint.shape == (SIDE, SIDE, 3)
    assert paint.min() > 0
    assert paint.max() < 1
    assert paint.std() > 0.005


def test_paint_differs_between_parts_and_not_within_one() -> None:
    parts = draw_parts(PartKind.PEBBLES, np.random.default_rng(0), SIDE)
    colour = np.array([0.5, 0.3, 0.2])
    paints = [varied_paint(parts, colour, np.random.default_rng(seed)) for seed in range(8)]
    spread = [paint.std() for paint in paints]
    assert min(spread) == pytest.approx(np.tile(colour, (2, 1)).std())
    for paint in paints:
        one = paint[parts.part == parts.part[5, 5]]
        assert np.ptp(one, axis=0).max() == 0
