"""Rendered pictures of objects on tables, their coverage, files and batches."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("mitsuba")

import torch

from isc_core.errors import InputError
from isc_core.networks.mask_network import SIDE, Count
from synth.scene.variant import load_mitsuba
from training.masks.composites import CompositeDraws, Composites
from training.masks.held_out import held_out_tabletops
from training.masks.tabletop_batches import TabletopBatches, WithTabletops
from training.masks.tabletop_pictures import (
    TabletopPicture,
    read_pictures,
    render_folder,
    rendered,
    write_pictures,
)
from training.masks.tabletop_scenes import OBJECT, TabletopScene, TabletopScenes
from training.world.bodies.body import Source
from training.world.bodies.sources import BodyReference
from training.world.patterns import make_atlas

from .white_shapes import ingredients

pytestmark = pytest.mark.usefixtures("one_torch_thread")

SHAPES = ("superquadric", "lathe")


def scenes(folder: Path, names: tuple[str, ...] = SHAPES, cameras: int = 2) -> TabletopScenes:
    references = [
        BodyReference(f"family/{name}/{k:04d}", Source.FAMILY, "", part=name, number=k)
        for name in names
        for k in range(3)
    ]
    sky = np.random.default_rng(0).uniform(0.2, 2, (8, 16, 3))
    return TabletopScenes(references, [sky], make_atlas(0, 6, 32), folder, cameras)


def picture(seed: int = 0, shape: tuple[int, int] = (60, 80)) -> TabletopPicture:
    """A grey square on noise."""
    rng = np.random.default_rng(seed)
    codes = rng.integers(40, 90, (*shape, 3)).astype(np.uint8)
    cover = np.zeros(shape, np.uint8)
    cover[20:40, 30:55] = 255
    codes[cover > 0] = 200
    return TabletopPicture(codes, cover)


def test_objects_stand_on_the_plane(tmp_path: Path) -> None:
    made = scenes(tmp_path)
    for seed in range(4):
        scene = made.draw(np.random.default_rng(seed))
        shape = load_mitsuba().load_dict(scene.mitsuba[OBJECT])
        low, high = np.array(shape.bbox().min), np.array(shape.bbox().max)
        assert -0.02 < low[1] <= 1e-4
        np.testing.assert_allclose((low + high)[[0, 2]], 0, atol=1e-4)


def test_what_is_covered_is_what_the_camera_sees_of_the_object(tmp_path: Path) -> None:
    """With an object that shines in the dark, light and coverage are the same picture."""
    drawn = scenes(tmp_path, cameras=3).draw(np.random.default_rng(5))
    shining = dict(drawn.mitsuba[OBJECT])
    shining["bsdf"] = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    shining["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    table: dict[str, Any] = {**drawn.mitsuba["table"], "bsdf": black}
    scene = {"type": "scene", OBJECT: shining, "table": table}
    found = rendered(TabletopScene(scene, drawn.sensors, drawn.landscape), 64, 64, 0)
    assert found
    for one in found:
        light, cover = one.light.mean(axis=2) / one.light.max(), one.cover / 255
        # eight random rays a pixel against sixty-four: a deviation of .19 at the rim
        inner = (cover == 0) | (cover == 1)
        assert np.abs(light - cover)[inner].mean() < 0.01
        assert np.abs(light - cover).max() < 0.85
        assert 0.015 < (cover > 0.5).mean() < 0.75


@pytest.mark.slow
def test_an_object_behind_is_no_part_of_the_mask(tmp_path: Path) -> None:
    drawn = scenes(tmp_path, cameras=3).draw(np.random.default_rng(6))
    mi = load_mitsuba()
    before = [one.cover for one in rendered(drawn, 48, 4, 0)]
    bounds = mi.load_dict(drawn.mitsuba[OBJECT]).bbox()
    wall = {
        "type": "sphere",
        "center": [0, float(bounds.max[1]) / 2, 0],
        "radius": 40.0,
        "flip_normals": True,
    }
    behind = TabletopScene({**drawn.mitsuba, "room": wall}, drawn.sensors, drawn.landscape)
    after = [one.cover for one in rendered(behind, 48, 4, 0)]
    assert len(before) == len(after) > 0
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_an_interrupted_folder_is_completed(tmp_path: Path) -> None:
    made = scenes(tmp_path / "meshes", cameras=2)
    (tmp_path / "meshes").mkdir()
    folder = tmp_path / "pictures"
    folder.mkdir()
    assert render_folder(made, folder, 2, 0, 48) > 0
    kept = (folder / "00001.npz").read_bytes()
    (folder / "00000.npz").unlink()
    render_folder(made, folder, 2, 0, 48)
    assert (folder / "00000.npz").exists() and (folder / "00001.npz").read_bytes() == kept


def test_pictures_are_read_as_written(tmp_path: Path) -> None:
    wanted = [picture(0), picture(1, (80, 60))]
    write_pictures(tmp_path / "00000.npz", wanted)
    write_pictures(tmp_path / "00001.npz", [])
    for one, other in zip(read_pictures(tmp_path), wanted, strict=True):
        np.testing.assert_array_equal(one.codes, other.codes)
        np.testing.assert_array_equal(one.cover, other.cover)


def test_damaged_and_missing_pictures_are_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no pictures"):
        list(read_pictures(tmp_path))
    write_pictures(tmp_path / "00000.npz", [picture()])
    whole = (tmp_path / "00000.npz").read_bytes()
    (tmp_path / "00000.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"00000\.npz"):
        list(read_pictures(tmp_path))


def test_no_usable_object_is_reported(tmp_path: Path) -> None:
    missing = BodyReference("urdf/0001", Source.URDF, "", tmp_path / "missing.urdf")
    made = TabletopScenes([missing], [np.ones((4, 8, 3))], make_atlas(0, 2, 32), tmp_path)
    with pytest.raises(InputError, match="none of the objects"):
        made.draw(np.random.default_rng(0))


def test_batches_show_the_object_under_its_mask() -> None:
    draw = TabletopBatches([picture(0), picture(1, (80, 60))], 16, 0.0)
    batch = draw(np.random.default_rng(0))
    assert batch.photo.shape == (16, 3, SIDE, SIDE) and not batch.hints.any()
    assert (batch.count == int(Count.ONE)).all()
    assert not (batch.mask * (1 - batch.frame)).any()
    assert not (batch.photo * (1 - batch.frame)).any()
    grey = batch.photo.mean(1, keepdim=True)
    for photo, mask, frame in zip(grey, batch.mask, batch.frame, strict=True):
        away = (mask == 0) & (frame > 0)
        assert photo[mask > 0.9].median() > 2 * photo[away].median()
    areas = batch.mask.sum((1, 2, 3)) / batch.frame.sum((1, 2, 3))
    whole = 20 * 25 / (60 * 80)
    assert areas.min() > 0.9 * whole and areas.max() > 2 * whole  # whole pictures, and parts


def test_hints_lie_on_the_object_or_leave_no_mask() -> None:
    batch = TabletopBatches([picture()], 32, 1.0)(np.random.default_rng(1))
    shown = batch.mask.flatten(1).sum(1) > 0
    assert torch.equal(shown, batch.count == int(Count.ONE)) and not shown.all()
    for hints, mask in zip(batch.hints[shown], batch.mask[shown], strict=True):
        points = hints[0] > 0
        # discs of points at the rim reach beyond it
        assert not points.any() or mask[0][points].mean() > 0.5


def test_both_kinds_of_photos_are_joined() -> None:
    composites = Composites(ingredients(), draws := CompositeDraws(3), SIDE)
    both = WithTabletops(draws, composites, TabletopBatches([picture()], 5))
    torch.manual_seed(0)
    batch = both.composed(both.draw(np.random.default_rng(0)))
    assert len(batch) == 8 and batch.photo.shape == (8, 3, SIDE, SIDE)
    assert batch.count.dtype == torch.int64


def test_held_out_photos_have_the_size_of_the_pictures(tmp_path: Path) -> None:
    write_pictures(tmp_path / "00000.npz", [picture(0), picture(1, (80, 60))])
    first, again = (list(held_out_tabletops(tmp_path, 3)) for _ in range(2))
    assert [one.light.shape for one in first] == [(60, 80, 3), (80, 60, 3)]
    assert first[0].count == Count.ONE and first[0].cover.max() == 1
    np.testing.assert_array_equal(first[1].light, again[1].light)
