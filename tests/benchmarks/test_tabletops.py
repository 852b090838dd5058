"""Photos of objects on tables and their truth, and the table of errors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

from benchmarks.tabletops.decomposition import KNOWN, UNKNOWN, WAYS, measured, report
from benchmarks.tabletops.rendering import TabletopPhoto, photographed
from isc_core.shading.perspective import view_directions
from tests.training.masks.test_tabletops import scenes
from training.tabletops.scenes import OBJECT, TabletopScene


def ball(folder: Path, gloss: bool, outside: bool = True) -> TabletopScene:
    """A ball on a table, whose faces may point inward."""
    drawn = scenes(folder, cameras=1).draw(np.random.default_rng(0))
    pattern = {"type": "rgb", "value": [0.4, 0.3, 0.2]}
    side = (
        {"type": "roughplastic", "alpha": 0.2, "diffuse_reflectance": pattern}
        if gloss
        else {"type": "diffuse", "reflectance": pattern}
    )
    shape = {
        "type": "sphere",
        "center": [0, 0.7, 0],
        "radius": 0.7,
        "flip_normals": not outside,
        "bsdf": {"type": "twosided", "side": side},
    }
    kept = {name: drawn.mitsuba[name] for name in ("type", "sky", "table")}
    return replace(drawn, mitsuba={**kept, OBJECT: shape})


def taken(scene: TabletopScene, side: int = 32) -> TabletopPhoto:
    photo = photographed(scene, side, 16, 0)
    assert photo is not None
    return photo


def test_normals_are_those_of_the_ball_before_the_camera(tmp_path: Path) -> None:
    """The ball is convex: with its centre c, the point of a ray is c + r n, wherever the faces
    point.
    """
    for outside in (True, False):
        truth = taken(ball(tmp_path, False, outside), 64)
        mask, camera = truth.photo.mask, truth.photo.camera
        assert camera is not None and mask.any()
        ray = -view_directions(camera, (mask.shape[0], mask.shape[1]))[mask]
        normal = truth.normal[mask]
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-5)
        assert (np.einsum("nc,nc->n", normal, ray) < 0).all()
        # depth t of each ray and the centre c solve t d - r n = c
        count = len(ray)
        system, wanted = np.zeros((3 * count, count + 3)), 0.7 * normal.ravel()
        for k in range(count):
            system[3 * k : 3 * k + 3, k] = ray[k]
            system[3 * k : 3 * k + 3, count:] = -np.eye(3)
        found, *_ = np.linalg.lstsq(system, wanted, rcond=None)
        np.testing.assert_allclose(system @ found, wanted, atol=2e-3)
        assert not truth.normal[~mask].any()


def test_the_diffuse_layer_is_the_photo_without_gloss(tmp_path: Path) -> None:
    glossy, matt = (taken(ball(tmp_path, gloss)) for gloss in (True, False))
    assert glossy.glossy and not matt.glossy
    for one in (glossy, matt):
        assert (one.diffuse <= one.photo.image).all() and one.diffuse.min() >= 0
    share = [
        float((one.photo.image - one.diffuse)[one.photo.mask].mean() / one.photo.image.mean())
        for one in (glossy, matt)
    ]
    assert share[0] > 0.05 and share[1] < 0.01


@pytest.mark.slow
def test_a_photo_is_measured(tmp_path: Path) -> None:
    rows = [measured(taken(ball(tmp_path, gloss))) for gloss in (True, False)]
    assert "glossy" in rows[0] and "matt" in rows[1]
    for row in rows:
        assert all(0 < row[f"{way}, {known}"] < 60 for way in WAYS for known in (KNOWN, UNKNOWN))


def test_the_table_has_means_intervals_and_differences() -> None:
    row = {f"{way}, {known}": 10.0 for way in WAYS for known in (KNOWN, UNKNOWN)}
    worse = {**row, f"{WAYS[0]}, {KNOWN}": 14.0}
    text = report([{**row, "glossy": 0.5}, {**worse, "matt": 0.0}])
    assert f"| {WAYS[0]} | 12 (10 to 14) | 10 (10 to 10) |" in text
    assert f"| {WAYS[0]} minus {WAYS[1]} | 2 (0 to 4); 1 above 1 | 0 (0 to 0); 0 above 1 |" in text
    assert "1 glossy objects, relative squared error: 0.5" in text
