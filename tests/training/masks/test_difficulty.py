"""Difficult composites: compound targets, targets that the frame cuts, defocus, bands."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from scipy import ndimage

from isc_core.networks.mask_network import Count
from training.masks.bands import draw_bands, painted
from training.masks.composites import CompositeDraws, Composites
from training.masks.defocus import defocused, draw_defocus
from training.masks.difficulty import DIFFICULT, SIMPLE, Difficulty
from training.masks.ingredients import SIDE
from training.masks.scenes import MAX_OBJECTS, draw_scenes
from training.masks.targets import MOST_PARTS, cut_by_frame, draw_parts

from .white_shapes import ingredients

pytestmark = pytest.mark.usefixtures("one_torch_thread")
ONE = (0.0, 1.0, 0.0)


def compose(
    difficulty: Difficulty, size: int = 12, hinted: float = 0, side: int = 64
) -> Composites:
    draw = CompositeDraws(size, hinted, ONE, (0, 0), difficulty=difficulty)
    return Composites(ingredients(), draw, side)


def test_a_compound_target_is_one_object_with_one_mask() -> None:
    scenes, objects = draw_scenes(np.random.default_rng(0), 60, ONE, Difficulty(compound=1))
    parts = torch.bincount(objects.photo[objects.target])
    assert int(parts.min()) == 2 and int(parts.max()) == MOST_PARTS
    assert int(objects.layer.max()) < MAX_OBJECTS and (scenes.count == int(Count.ONE)).all()
    batch = compose(Difficulty(compound=1), 24)(np.random.default_rng(1))
    assert (batch.count == int(Count.ONE)).all()
    pieces = []
    for mask in batch.mask[:, 0].numpy():
        labels, _ = ndimage.label(mask > 0.5, np.ones((3, 3)))
        pieces.append((np.bincount(labels.ravel())[1:] > 0.1 * (labels > 0).sum()).sum())
    assert np.mean(np.array(pieces) == 1) > 0.9


def test_parts_fill_the_square_of_their_object() -> None:
    parts = draw_parts(np.random.default_rng(2), 200)
    present = np.arange(MOST_PARTS) < parts.number[:, None]
    low, high = (
        np.where(present[..., None], parts.place + side * parts.length[..., None], -side * np.inf)
        for side in (-1, 1)
    )
    extent = high.max(axis=1) - low.min(axis=1)
    np.testing.assert_allclose(extent.max(axis=1), 2)
    np.testing.assert_allclose(high.max(axis=1) + low.min(axis=1), 0, atol=1e-12)


def test_hints_on_a_part_select_the_whole_compound() -> None:
    made, rng = compose(Difficulty(compound=1), 8, hinted=1), np.random.default_rng(3)
    draw = CompositeDraws(8, 1, ONE, (0, 0), difficulty=Difficulty(compound=1))(rng)
    same = torch.ones(8, dtype=torch.bool)
    on_target = replace(draw, hints=replace(draw.hints, background=~same, same=same))
    unhinted = replace(draw, hints=replace(draw.hints, given=~same))
    hinted = replace(on_target, hints=replace(on_target.hints, given=same))
    torch.testing.assert_close(made.composed(hinted).mask, made.composed(unhinted).mask)


def test_targets_are_cut_by_one_or_two_sides() -> None:
    rng = np.random.default_rng(4)
    shape = np.tile([1, 0.75], (300, 1))
    length, place = cut_by_frame(rng, shape, 1.0)
    assert length.min() > 0.5 and 1.2 < length.max() < 1.5
    assert (np.abs(place) < shape).all(), "the centre is visible"
    cut = (np.abs(place) + length[:, None] > shape + 0.01).sum(axis=1)
    assert (cut >= 1).mean() > 0.95 and (cut == 2).mean() > 0.1
    border = np.zeros((64, 64), bool)
    border[[0, -1]] = border[:, [0, -1]] = True

    def touching(difficulty: Difficulty) -> float:
        batch = compose(difficulty, 24)(np.random.default_rng(5))
        inside = torch.nn.functional.avg_pool2d(batch.frame, 3, 1, 1) > 0.99
        return float((batch.mask * ~inside > 0.5).flatten(1).any(1).float().mean())

    assert touching(Difficulty(cut=1)) > touching(SIMPLE) + 0.3


def test_defocus_spreads_points_over_discs_and_keeps_the_light() -> None:
    light = torch.full((2, 3, 65, 65), 1e-3)
    light[:, :, 32, 32] = 1
    drawn = draw_defocus(np.random.default_rng(6), 2, 1.0)
    same = torch.ones(2)
    drawn = replace(drawn, radius=0.08 * same, edge=torch.tensor([10.0, -10]), highlights=0 * same)
    far, near = defocused(light, drawn)
    torch.testing.assert_close(near, light[1], atol=1e-6, rtol=1e-4)
    assert float(far.mean()) == pytest.approx(float(light.mean()), rel=1e-4)
    rows, columns = torch.nonzero(far[0] > 4e-3, as_tuple=True)
    radius = 0.08 * 65
    assert float(torch.hypot(rows - 32.0, columns - 32.0).max()) == pytest.approx(radius, abs=1)
    assert len(rows) == pytest.approx(np.pi * radius**2, rel=0.15)


def test_only_what_lies_behind_the_target_is_defocused() -> None:
    torch.manual_seed(0)
    draw = CompositeDraws(12, 0, ONE, (0.5, 0.5), difficulty=Difficulty(defocused=1))
    made = Composites(ingredients(), draw, 64)
    batch = draw(np.random.default_rng(7))
    photos, objects = [], batch.objects
    quiet = replace(objects, strength=0 * objects.strength, gain=torch.ones(len(objects), 3))
    clear = replace(batch.cameras, blur=0 * batch.cameras.blur, noise=0 * batch.cameras.noise)
    for defocus in (None, batch.defocus):
        torch.manual_seed(0)
        photos.append(made.composed(replace(batch, objects=quiet, cameras=clear, defocus=defocus)))
    sharp, blurred = photos
    assert torch.equal(sharp.mask, blurred.mask)
    assert not torch.equal(sharp.photo, blurred.photo)


def test_bands_change_parts_of_some_objects_by_three_factors() -> None:
    _, objects = draw_scenes(np.random.default_rng(8), 30, ONE)
    number = len(objects)
    objects = replace(objects, length=torch.full((number,), float(SIDE)), place=objects.place * 0)
    drawn = draw_bands(np.random.default_rng(9), number, 0.5)
    factor = painted(torch.ones(number, 3, 64, 64), objects, drawn)
    assert 0 < int(drawn.present.sum()) < number and (factor[~drawn.present] == 1).all()
    found, wanted = factor[drawn.present], drawn.factor[drawn.present][..., None, None]
    least, most = wanted.clamp(max=1) - 1e-5, wanted.clamp(min=1) + 1e-5
    assert ((found >= least) & (found <= most)).all()
    full = torch.isclose(found, wanted, rtol=1e-3).all(1).flatten(1).float().mean(1)
    assert (full > 0.02).all()


def test_the_numbers_of_simple_photos_do_not_depend_on_difficulty() -> None:
    simple, difficult = (
        CompositeDraws(6, 0.5, varied=True, difficulty=one)(np.random.default_rng(10))
        for one in (SIMPLE, replace(DIFFICULT, compound=0, cut=0))
    )
    assert torch.equal(simple.objects.place, difficult.objects.place)
    assert torch.equal(simple.cameras.exposure, difficult.cameras.exposure)
    assert simple.defocus is None and difficult.bands is not None
