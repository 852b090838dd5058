"""Composites, and their masks, hints and counts."""

import copy
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from isc_core.networks.mask_network import SIDE as FRAME
from isc_core.networks.mask_network import Count, channels_of
from training.masks.composites import CompositeDraws, Composites, frames
from training.masks.difficulty import DIFFICULT, SIMPLE
from training.masks.ingredients import LENGTH, cut_out
from training.masks.mask_module import MaskNetworkModule, network_channels
from training.masks.scenes import MAX_OBJECTS

from .white_shapes import ingredients

pytestmark = pytest.mark.usefixtures("one_torch_thread")


def drawn(count: Count, hinted: float = 0, size: int = 12, side: int = FRAME) -> Composites:
    shares = tuple(float(kind == count) for kind in Count)
    return Composites(ingredients(), CompositeDraws(size, hinted, shares, (0, 0)), side)


@pytest.mark.parametrize("count", list(Count))
def test_the_mask_is_empty_only_without_objects(count: Count) -> None:
    batch = drawn(count)(np.random.default_rng(0))
    assert (batch.count == int(count)).all() and not batch.hints.any()
    covered = batch.mask.flatten(1).sum(1)
    assert (covered == 0).all() if count == Count.NONE else (covered > 20).all()
    assert (
        not (batch.mask * (1 - batch.frame)).any() and not (batch.photo * (1 - batch.frame)).any()
    )


def test_white_objects_are_brighter_than_a_black_background() -> None:
    torch.manual_seed(0)
    batch = drawn(Count.ONE)(np.random.default_rng(1))
    grey = batch.photo.mean(1, keepdim=True)
    for photo, mask, frame in zip(grey, batch.mask, batch.frame, strict=True):
        away = (mask == 0) & (frame > 0)
        assert photo[mask > 0.9].median() > 3 * photo[away].median() + 1e-3


def test_hinted_photos_have_one_target_or_none() -> None:
    batch = drawn(Count.SEVERAL, hinted=1.0)(np.random.default_rng(3))
    assert set(batch.count.tolist()) <= {Count.NONE, Count.ONE}
    covered = batch.mask.flatten(1).sum(1) > 0
    assert torch.equal(covered, batch.count == Count.ONE)


def test_a_cut_out_object_has_its_length_and_its_colours() -> None:
    light, cover = torch.full((1, 3, 160, 160), 0.5), torch.zeros(1, 1, 160, 160)
    cover[:, :, 40:80, 20:120] = 1
    (cutout,) = cut_out(light, cover)
    rows, columns = np.nonzero(cutout[3] > 127)
    assert np.ptp(columns) + 1 == pytest.approx(LENGTH, abs=1)
    assert np.ptp(rows) + 1 == pytest.approx(0.4 * LENGTH, abs=1)
    assert cutout[:3, cutout[3] > 250].min() > 250, "the brightest is white"


def test_channels_equal_those_of_the_core() -> None:
    batch = drawn(Count.ONE, hinted=0.7, size=4)(np.random.default_rng(5))
    found = network_channels(batch).permute(0, 2, 3, 1).numpy()
    for k in range(4):
        parts = (batch.photo[k], batch.frame[k], batch.hints[k])
        light, frame, hints = (part.permute(1, 2, 0).numpy() for part in parts)
        wanted = channels_of(light, frame[..., 0] > 0, hints)
        np.testing.assert_allclose(found[k], wanted, atol=2e-5)


def test_frames_are_centred() -> None:
    frame = frames(torch.tensor([[1.0, 0.75]]), 32)[0, 0]
    assert frame.sum() == 32 * 24 and torch.equal(frame, frame.flip(0))


def test_training_lowers_the_loss_on_white_objects() -> None:
    torch.manual_seed(0)
    network = MaskNetworkModule((8, 12, 12, 8), (8, 8, 8))
    compose, rng = drawn(Count.ONE, size=8, side=32), np.random.default_rng(0)
    optimizer, losses = torch.optim.Adam(network.parameters(), 3e-3), []
    for _ in range(30):
        loss, _ = network.loss(compose(rng))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert np.mean(losses[-5:]) < 0.8 * np.mean(losses[:5])


@pytest.mark.parametrize("varied", [False, True])
def test_composition_does_not_read_values_from_the_device(varied: bool) -> None:
    # tensors of the device "meta" have shapes only: reading a value raises
    difficulty = DIFFICULT if varied else SIMPLE
    draw = CompositeDraws(6, 0.5, varied=varied, difficulty=difficulty)
    compose = Composites(ingredients(), draw, 64, "meta")
    batch = compose.composed(draw(np.random.default_rng(0)))
    wanted = Composites(ingredients(), draw, 64)(np.random.default_rng(0))
    for found, known in zip(vars(batch).values(), vars(wanted).values(), strict=True):
        assert found.is_meta and found.shape == known.shape and found.dtype == known.dtype


def test_draws_give_equal_composites_after_being_sent_to_another_process() -> None:
    draw = CompositeDraws(6, 0.5, varied=True)
    compose, photos = Composites(ingredients(), draw, 64), []
    for sent in (False, True):
        batch = draw(np.random.default_rng(7))
        batch = copy.deepcopy(batch) if sent else batch  # as processes exchange it
        torch.manual_seed(0)
        photos.append(compose.composed(batch))
    for one, other in zip(*(vars(photo).values() for photo in photos), strict=True):
        assert torch.equal(one, other)


def test_visible_parts_of_objects_do_not_overlap() -> None:
    compose, draw = drawn(Count.SEVERAL, size=40), CompositeDraws(40, 0, (0, 0, 1))
    batch = draw(np.random.default_rng(2))
    assert int(batch.objects.layer.max()) == MAX_OBJECTS - 1, "there are piles"
    alone = [
        compose.composed(
            replace(batch, objects=replace(batch.objects, target=batch.objects.layer == k))
        ).mask
        for k in range(MAX_OBJECTS)
    ]
    assert torch.allclose(torch.stack(alone).sum(0), compose.composed(batch).mask, atol=1e-4)
