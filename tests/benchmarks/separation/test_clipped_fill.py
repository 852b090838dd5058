"""The comparison of fills: what it does to a photo of a striped ball, and how it is summed up."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

from benchmarks.separation.clipped_fill import FillErrors, fill_errors, table
from benchmarks.separation.print_set import PrintScene

_SIDE = 64


def _scene() -> PrintScene:
    """A striped ball with a clipped highlight, in all of a frame."""
    line = np.linspace(-1.1, 1.1, _SIDE)
    x, y = np.meshgrid(line, -line)
    mask = x**2 + y**2 < 1
    paint = 0.3 + 0.2 * np.sign(np.sin(12 * x))
    diffuse = np.where(mask, paint, 0)[..., None].repeat(3, axis=2).astype(np.float32)
    clipped = np.hypot(x, y - 0.2) < 0.15
    photo = np.where(clipped[..., None], np.float32(1), diffuse)
    return PrintScene("001 stripes", "ball", photo, diffuse, mask, clipped)


@pytest.mark.slow
def test_a_glossy_object_has_both_kinds_of_holes_a_matt_one_made_ones_only() -> None:
    found = fill_errors(_scene(), glossy=True)
    assert [one.kind for one in found] == ["clipped", "made"]
    assert all(one.body == "ball" and 0 < min(one.whole, one.near) < 4 for one in found)
    assert [one.kind for one in fill_errors(_scene(), glossy=False)] == ["made"]


def test_ratios_are_of_each_hole_and_of_the_means() -> None:
    one = FillErrors("a", "made", 1.0, 2.0, 4.0, 1.0)
    other = replace(one, body="b", whole=3.0, near=1.5)
    rows = [row.split(" | ") for row in table([one, other]).splitlines()[2:]]
    assert [row[0] for row in rows] == ["| made", "| all"]
    for row in rows:
        assert row[1] == "2"
        assert row[2] == "1.000 (0.500-2.000)"
        assert row[3] == "0.875 (0.500-2.000)"
        assert row[4] == "0.25 |"
