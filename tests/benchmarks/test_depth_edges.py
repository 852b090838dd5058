"""The experiment with cuts at steps in depth: what it cuts, and how it counts."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs the extra `training`")
pytest.importorskip("mitsuba", reason="needs the extra `synth`")

from benchmarks.blender.cut_bodies import cut, steps_of
from benchmarks.blender.depth_edge_views import SeenBody
from benchmarks.blender.depth_edges import (
    SHARES,
    logistic,
    precisions,
    step_shares,
)
from isc_core.result_files.solids.back import Back
from isc_core.result_files.solids.rim import Rim
from isc_core.result_files.solids.solid_mesh import make_solid_mesh
from isc_core.result_files.turned_view import turned_view

SIZE, JUMP = 60, 12.0


def plates(width: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A plate before another one; the step between them is a slope so many pixels wide."""
    mask = np.zeros((SIZE, SIZE), bool)
    mask[6:-6, 6:-6] = True
    ramp = np.clip((np.arange(SIZE) - SIZE / 2 + 0.5) / max(width, 1e-9) + 0.5, 0, 1)
    return np.where(mask, JUMP * ramp, 0), mask


def test_a_step_is_between_two_pixels_and_a_slope_is_none() -> None:
    height, mask = plates()
    steps = steps_of(height, mask, JUMP / 2)
    rows, columns = np.nonzero(steps.front)
    assert set(columns) == {30} and len(rows) == SIZE - 12
    assert set(np.nonzero(steps.behind)[1]) == {29}
    assert set(np.nonzero(steps.cells)[1]) == {29}
    assert not steps_of(*plates(8), JUMP / 2).cells.any()


def test_a_cut_leaves_no_hole_from_the_side() -> None:
    height, mask = plates()
    body = make_solid_mesh(height, np.ones(mask.shape), mask, Rim(mask), Back.FLAT, 0)
    vertices, faces = cut(body, height, mask, steps_of(height, mask, JUMP / 2))
    whole = np.stack([body.places[:, 1], -body.places[:, 0], body.heights], -1)
    for yaw in (-30.0, 0.0, 30.0):
        seen, before = (
            turned_view(v - whole.mean(0), f, np.ones((len(v), 3)), yaw, 90, 1.0).coverage
            for v, f in ((vertices, faces), (whole, body.faces))
        )
        assert np.abs(seen - before).max() < 0.6 and np.abs(seen - before).mean() < 0.002
    assert len(faces) != len(body.faces)


def test_the_share_of_a_step_that_heights_have() -> None:
    depth, mask = plates()
    arrays = np.zeros((SIZE, SIZE))
    body = SeenBody(arrays, mask, depth, arrays, 0.25 * depth, arrays, arrays, arrays)
    np.testing.assert_allclose(step_shares([body]), 0.25)


def test_the_regression_ranks_by_the_informative_feature() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(4000, 3))
    labels = values[:, 1] + 0.3 * rng.normal(size=4000) > 1
    found = precisions(logistic(values, labels)(values), labels)
    assert found[0] > 0.95 and len(found) == len(SHARES)
    assert precisions(labels.astype(float), labels) == [1.0] * len(SHARES)
    assert max(precisions(values[:, 0], labels)) < 0.35
