"""Points correct a mask where they contradict it, and leave the rest."""

import numpy as np
import pytest

from isc_core.masking.corrections import corrected
from isc_core.masking.crops import Crop, CropPrediction, predict_crop
from isc_core.masking.hints import Hints
from isc_core.masking.search import find_mask
from isc_core.networks.mask_network import SIDE, MaskNetwork
from isc_core.photo.found_mask import FoundMask
from tests.core.masking.ball_photos import ONE, TWO, balls, overlap

SHAPE = (150, 200)
LIGHT = np.full((*SHAPE, 3), 0.2, np.float32)


def found(*boxes: tuple[int, int, int, int], confidence: float = 0.8) -> FoundMask:
    """A mask of boxes (left, top, right, bottom)."""
    cover = np.zeros(SHAPE, np.float32)
    for left, top, right, bottom in boxes:
        cover[top:bottom, left:right] = 1
    return FoundMask(cover, confidence, np.array([0.0, 1.0, 0.0]), np.zeros(6))


BODY, HEAD, OTHER = (50, 60, 100, 140), (60, 20, 90, 60), (140, 60, 190, 140)


def test_a_point_that_agrees_changes_nothing() -> None:
    mask = found(BODY)
    hints = Hints(points=((70, 100),))
    assert vars(corrected(LIGHT, mask, found(HEAD), hints, usable=True)) == vars(mask)


def test_a_point_on_the_object_never_loses_what_was_found() -> None:
    """The network finds only the part with the point."""
    hints = Hints(points=((75, 40),))
    after = corrected(LIGHT, found(BODY), found(HEAD), hints, usable=True)
    assert (after.mask == found(BODY, HEAD).mask).all()


def test_a_mask_that_would_not_be_used_gives_way_to_that_of_the_network() -> None:
    hints, hinted = Hints(points=((75, 40),)), found(HEAD)
    assert vars(corrected(LIGHT, found(BODY, OTHER), hinted, hints, usable=False)) == vars(hinted)


def test_points_of_both_kinds_choose_the_mask_of_the_network_if_it_agrees() -> None:
    hints, hinted = Hints(((75, 100),), ((165, 100),)), found(BODY, HEAD)
    assert vars(corrected(LIGHT, found(BODY, OTHER), hinted, hints, usable=True)) == vars(hinted)


def test_a_component_with_a_point_on_the_background_is_dropped() -> None:
    hints, mask = Hints(background=((165, 100),)), found(BODY, OTHER)
    after = corrected(LIGHT, mask, mask, hints, usable=True)
    assert (after.cover == found(BODY).cover).all()


def test_a_point_on_the_background_changes_its_side_of_an_edge() -> None:
    light = LIGHT.copy()  # a bright object and its dark shadow
    light[60:140, 50:75], light[60:140, 75:100] = 0.6, 0.08
    rng = np.random.default_rng(0)
    light *= rng.uniform(0.98, 1.02, light.shape).astype(np.float32)
    hints, mask = Hints(background=((90, 100),)), found(BODY)
    after = corrected(light, mask, mask, hints, usable=True)
    assert overlap(after.mask, mask.mask & (np.arange(SHAPE[1]) < 75)) > 0.9
    assert after.confidence == pytest.approx(mask.confidence)


def test_the_confidence_falls_with_the_points_that_cannot_be_met() -> None:
    """Two neighbouring pixels at the same place of a small picture contradict each other."""
    hints, mask = Hints(((70, 100),), ((71, 100),)), found(BODY)
    after = corrected(LIGHT, mask, mask, hints, usable=True)
    assert after.confidence < mask.confidence


def test_a_point_in_the_middle_of_a_found_object_keeps_its_mask(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And the network is not run again; it is for a point that contradicts the mask."""
    crops = list[Crop]()

    def counted(
        light: np.ndarray, crop: Crop, hints: Hints, network: MaskNetwork, side: int = SIDE
    ) -> CropPrediction:
        crops.append(crop)
        return predict_crop(light, crop, hints, network, side)

    monkeypatch.setattr("isc_core.masking.search.predict_crop", counted)
    light, _ = balls(ONE)
    before = find_mask(light)
    once = list(crops)
    assert len(once) == 3
    for hints in (Hints(points=((100, 75),)), Hints(((100, 75),), ((5, 5),))):
        crops.clear()
        after = find_mask(light, hints)
        assert (after.cover == before.cover).all() and after.confidence == before.confidence
        assert crops == once
    crops.clear()
    find_mask(light, Hints(points=((5, 5),)))
    assert len(crops) == 2 * len(once)


def test_a_point_on_the_background_removes_the_other_object() -> None:
    light, (left, _) = balls(TWO)
    after = find_mask(light, Hints(background=((150, 75),)))
    assert overlap(after.mask, left) > 0.8


def test_a_point_on_another_object_gets_that_object() -> None:
    """The network's mask with the point lies apart from the mask without it."""
    hints, hinted = Hints(points=((165, 100),)), found(OTHER)
    assert vars(corrected(LIGHT, found(BODY), hinted, hints, usable=True)) == vars(hinted)
