"""The scenes that the judge of photos learns from: the same each time, and what their kind says."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from isc_core.shading.environment_map import solid_angles
from synth.scene.meshes import Mesh, write_ply
from synth.shapes import make_shape
from training.data import rendered_scenes
from training.data.environments import PLACES, ROWS, make_surroundings
from training.data.rendered_scenes import KINDS, SIZE, Given, make_scene


@pytest.fixture(autouse=True)
def _few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rendered_scenes, "SAMPLES", 4)


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_is_the_same_each_time_and_black_around_the_object(kind: str) -> None:
    scene, again = make_scene(kind, 3), make_scene(kind, 3)
    layers, mask = scene["layers"].astype(float), scene["mask"]
    assert mask.shape == (SIZE, SIZE) and 0.1 < mask.mean() < 0.9
    assert np.isfinite(layers).all() and layers.min() >= 0 and not layers[:, ~mask].any()
    assert (layers[:, mask].mean((1, 2)) > 1e-3).all()
    assert len(layers) == 1 if kind != "rig" else len(layers) >= 3
    np.testing.assert_array_equal(again["layers"], scene["layers"])


def test_a_given_mesh_is_what_is_seen(tmp_path: Path) -> None:
    mesh: Mesh = make_shape("superquadric", np.random.default_rng(0))
    write_ply(tmp_path / "thing.ply", mesh)
    found = make_scene("matt", 0, Given(mesh=tmp_path / "thing.ply"))
    assert str(found["shape"]) == "thing" and found["mask"].mean() > 0.1


@pytest.mark.parametrize("place", PLACES)
def test_surroundings_are_lit_and_differ(place: str) -> None:
    one, other = (make_surroundings(place, np.random.default_rng(k)) for k in (0, 1))
    assert one.shape == (ROWS, 2 * ROWS, 3) and np.isfinite(one).all() and one.min() > 0
    assert (one.mean(-1) * solid_angles(ROWS)).sum() > 0.1 and not np.allclose(one, other)
    np.testing.assert_array_equal(one, make_surroundings(place, np.random.default_rng(0)))
