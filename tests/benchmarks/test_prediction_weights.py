"""Halves of the held-out bodies, on which weights are chosen and reported, and their photos."""

from pathlib import Path

import pytest

pytest.importorskip("torch")

from benchmarks.sirfs.prediction_weights import lit_bodies
from tests.training.masks.test_held_out import HELD_OUT, world_folder
from training.networks import scene_batches
from training.world.files import Split, half_of, split_of


def test_halves_of_held_out_bodies_are_about_equal() -> None:
    held_out = [
        name for k in range(8000) if split_of(name := f"built/box/{k}") is Split.UNSEEN_BODY
    ]
    assert 0.45 < sum(map(half_of, held_out)) / len(held_out) < 0.55


def test_parts_of_one_piece_of_furniture_lie_in_one_half() -> None:
    parts = [
        {half_of(f"furniture/Scopia/ext-table_{k}-{part}") for part in (0, 1, 12)}
        for k in "abcdefgh"
    ]
    assert all(len(halves) == 1 for halves in parts) and set.union(*parts) == {0, 1}


@pytest.mark.slow
def test_each_body_is_photographed_from_one_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene_batches, "_PROCEDURAL", 0)
    world = world_folder(tmp_path, HELD_OUT[:3], 6)
    photos = lit_bodies(world, tmp_path / "hdri", 6, 0)
    assert len(photos) == 3
