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
from training.tabletops.__main__ import render_folder
from training.tabletops.pictures import (
    TabletopPicture,
    read_pictures,
    rendered,
    write_pictures,
)
from training.tabletops.scenes import (
    OBJECT,
    ONE_OBJECT,
    TabletopScene,
    TabletopScenes,
)
from training.tabletops.sources import TabletopSources
from training.world.bodies.body import Source
from training.world.bodies.sources import BodyReference
from training.world.patterns import make_atlas

from .white_shapes import ingredients

pytestmark = pytest.mark.usefixtures("one_torch_thread")

SHAPES = ("superquadric", "lathe")
NO_OBJECT, SEVERAL_OBJECTS = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def scenes(
    folder: Path,
    names: tuple[str, ...] = SHAPES,
    cameras: int = 2,
    shares: tuple[float, float, float] = ONE_OBJECT,
) -> TabletopScenes:
    references = [
        BodyReference(f"family/{name}/{k:04d}", Source.FAMILY, "", part=name, number=k)
        for name in names
        for k in range(3)
    ]
    sky = np.random.default_rng(0).uniform(0.2, 2, (8, 16, 3))
    sources = TabletopSources(references, [sky], make_atlas(0, 6, 32))
    return TabletopScenes(sources, folder, cameras, shares)


def picture(seed: int = 0, shape: tuple[int, int] = (60, 80), objects: int = 1) -> TabletopPicture:
    """Grey squares, one below the other, on noise."""
    rng = np.random.default_rng(seed)
    codes = rng.integers(40, 90, (*shape, 3)).astype(np.uint8)
    covers = np.zeros((*shape, objects), np.uint8)
    for k in range(objects):
        covers[20 + 22 * k : 40 + 22 * k, 30:55, k] = 255
    codes[covers.any(2)] = 200
    return TabletopPicture(codes, covers)


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
        light, cover = one.light.mean(axis=2) / one.light.max(), one.cover
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
    wanted = [picture(0), picture(1, (80, 60)), picture(objects=2), picture(objects=0)]
    write_pictures(tmp_path / "00000.npz", wanted)
    write_pictures(tmp_path / "00001.npz", [])
    for one, other in zip(read_pictures(tmp_path), wanted, strict=True):
        np.testing.assert_array_equal(one.codes, other.codes)
        np.testing.assert_array_equal(one.covers, other.covers)
        assert one.count == other.count


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
    sources = TabletopSources([missing], [np.ones((4, 8, 3))], make_atlas(0, 2, 32))
    made = TabletopScenes(sources, tmp_path)
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
    batch = TabletopBatches([picture()], 96, 1.0)(np.random.default_rng(1))
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
    write_pictures(tmp_path / "00000.npz", [picture(0), picture(1, (80, 60)), picture(objects=0)])
    first, again = (list(held_out_tabletops(tmp_path, 3)) for _ in range(2))
    assert [one.light.shape for one in first] == [(60, 80, 3), (80, 60, 3), (60, 80, 3)]
    assert first[0].count == Count.ONE and first[0].cover.max() == 1
    assert first[2].count == Count.NONE and not first[2].cover.any()
    np.testing.assert_array_equal(first[1].light, again[1].light)


@pytest.mark.slow
def test_several_objects_stand_apart_and_are_covered_each(tmp_path: Path) -> None:
    made = scenes(tmp_path, cameras=3, shares=SEVERAL_OBJECTS)
    for seed in range(6):
        scene = made.draw(np.random.default_rng(seed))
        assert scene.count == Count.SEVERAL and 2 <= len(scene.objects) <= 4
        boxes = [load_mitsuba().load_dict(scene.mitsuba[name]).bbox() for name in scene.objects]
        for k, one in enumerate(boxes):
            for other in boxes[:k]:
                overlap = np.minimum(one.max, other.max) - np.maximum(one.min, other.min)
                # boxes of neighbours in a diagonal may overlap at their corners
                assert min(overlap[0], overlap[2]) < 0.3
    for one in rendered(scene, 64, 4, 0):
        assert one.count == Count.SEVERAL and one.covers.shape[2] == len(scene.objects)
        # no ray meets two objects first
        assert one.covers.sum(axis=2, dtype=int).max() <= 255 + len(scene.objects)
        assert all(cover.any() for cover in np.moveaxis(one.covers, 2, 0))


@pytest.mark.slow
def test_cameras_beside_the_object_do_not_see_it(tmp_path: Path) -> None:
    made = scenes(tmp_path, cameras=4, shares=NO_OBJECT)
    found = 0
    for seed in range(4):
        scene = made.draw(np.random.default_rng(seed))
        pictures = rendered(scene, 48, 4, 0)
        found += len(pictures)
        assert all(one.count == Count.NONE and not one.cover.any() for one in pictures)
    assert found >= 8


def touches_frame(mask: torch.Tensor, frame: torch.Tensor) -> bool:
    inside = mask[frame.any(1)][:, frame.any(0)]
    return bool(inside[[0, -1]].any() or inside[:, [0, -1]].any())


def test_batches_show_none_and_several_and_cut_objects() -> None:
    shape = (90, 80)
    drawn = TabletopBatches([picture(0, shape, n) for n in range(3)], 96, 0.0)
    batch = drawn(np.random.default_rng(2))
    assert {int(n) for n in batch.count} == {int(kind) for kind in Count}
    empty = batch.count == int(Count.NONE)
    assert not batch.mask[empty].any() and batch.mask[~empty].flatten(1).any(1).all()
    one = batch.count == int(Count.ONE)
    cut = [
        touches_frame(mask[0] > 0.5, frame[0] > 0)
        for mask, frame in zip(batch.mask[one], batch.frame[one], strict=True)
    ]
    assert 0 < sum(cut) < len(cut) / 2


def test_hints_select_one_of_several_objects() -> None:
    batch = TabletopBatches([picture(0, (90, 80), 2)], 48, 1.0)(np.random.default_rng(3))
    shown = batch.mask.flatten(1).sum(1) > 0
    assert torch.equal(shown, batch.count == int(Count.ONE)) and shown.any() and not shown.all()
    for mask in batch.mask[shown]:
        assert mask.max() > 0.9
    areas = batch.mask[shown].sum((1, 2, 3)) / batch.frame[shown].sum((1, 2, 3))
    both = 2 * 20 * 25 / (90 * 80)
    assert areas.min() < 0.6 * both
