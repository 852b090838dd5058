"""Rendered scenes are reproducible, and black around the object."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from isc_core.shading.environment_map import solid_angles
from synth.scene.meshes import Mesh, write_ply
from synth.shapes import make_shape
from training.data import rendered_scenes
from training.data.environments import ENVIRONMENTS, ROWS, make_environment
from training.data.rendered_scenes import SIZE, SceneFiles, SceneKind, make_scene, scenes_in


@pytest.fixture(autouse=True)
def _few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rendered_scenes, "SAMPLES", 4)


@pytest.mark.slow
@pytest.mark.parametrize("kind", SceneKind)
def test_a_scene_is_reproducible_and_black_around_the_object(kind: SceneKind) -> None:
    scene, again = make_scene(kind, 3), make_scene(kind, 3)
    layers, mask = scene["layers"].astype(float), scene["mask"]
    assert mask.shape == (SIZE, SIZE) and 0.1 < mask.mean() < 0.9
    assert np.isfinite(layers).all() and layers.min() >= 0 and not layers[:, ~mask].any()
    assert (layers[:, mask].mean((1, 2)) > 1e-3).all()
    assert len(layers) == 1 if kind != SceneKind.RIG else len(layers) >= 3
    np.testing.assert_array_equal(again["layers"], scene["layers"])


@pytest.mark.slow
def test_a_mesh_file_replaces_the_shape(tmp_path: Path) -> None:
    mesh: Mesh = make_shape("superquadric", np.random.default_rng(0))
    write_ply(tmp_path / "thing.ply", mesh)
    scene = make_scene(SceneKind.DIFFUSE, 0, SceneFiles(mesh=tmp_path / "thing.ply"))
    assert str(scene["shape"]) == "thing" and scene["mask"].mean() > 0.1


@pytest.mark.parametrize(
    ("name", "kind"),
    [("lights_00000", SceneKind.SEVERAL_LIGHTS), ("matt_00000", SceneKind.DIFFUSE)],
)
def test_scenes_are_read_under_new_and_former_names(
    tmp_path: Path, name: str, kind: SceneKind
) -> None:
    arrays = {
        "layers": np.ones((1, 2, 2, 3), np.float16),
        "mask": np.ones((2, 2), bool),
        "shape": np.array("blob"),
        "surroundings": np.array("room"),
    }
    np.savez(tmp_path / f"{name}.npz", **arrays)  # type: ignore[arg-type]
    (scene,) = scenes_in(tmp_path)
    assert (scene.kind, scene.shape, scene.environment) == (kind, "blob", "room")
    assert scene.layers.dtype == np.float32


@pytest.mark.slow
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_environments_are_lit_and_differ(name: str) -> None:
    one, other = (make_environment(name, np.random.default_rng(k)) for k in (0, 1))
    assert one.shape == (ROWS, 2 * ROWS, 3) and np.isfinite(one).all() and one.min() > 0
    assert (one.mean(-1) * solid_angles(ROWS)).sum() > 0.1 and not np.allclose(one, other)
    np.testing.assert_array_equal(one, make_environment(name, np.random.default_rng(0)))
