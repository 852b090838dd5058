"""Panoramas of composites have the split of the other networks."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from isc_core.errors import InputError
from isc_core.io.exr import write_channels
from training.world.backgrounds import ROWS, panoramas_in
from training.world.environments import read_panoramas


def write(path: Path, radiance: float) -> None:
    write_channels(path, {name: np.full((64, 128), radiance, np.float32) for name in "RGB"})


def test_panoramas_have_the_split_of_the_other_networks(tmp_path: Path) -> None:
    for k in range(6):
        write(tmp_path / f"{'abcdef'[k]}.exr", k + 1)
    held_out = [k for k, one in enumerate(read_panoramas(tmp_path)) if one.held_out]
    found = panoramas_in(tmp_path, held_out=True)
    assert found.shape == (1, ROWS, 2 * ROWS, 3) and held_out == [round(float(found.mean())) - 1]
    others = panoramas_in(tmp_path, held_out=False).mean((1, 2, 3))
    assert sorted([*others.round().astype(int) - 1, *held_out]) == list(range(6))


def test_too_few_panoramas_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "one.exr", 1)
    with pytest.raises(InputError, match="too few panoramas"):
        panoramas_in(tmp_path, held_out=True)
