"""The two parts of what training leaves out share no body and no light."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from isc_core.errors import InputError
from tests.training.world.analytic_views import ellipsoid_view
from tests.training.world.test_environments import photo, write
from training.masks import held_out
from training.networks import scene_batches
from training.networks.scene_batches import World, read_world
from training.world.files import (
    VIEWS,
    Split,
    WorldSettings,
    claim_folder,
    half_of,
    split_of,
    write_patterns,
    write_views,
)
from training.world.patterns import Atlas

HELD_OUT = [
    name for k in range(200) if split_of(name := f"family/ball/{k:04d}") is Split.UNSEEN_BODY
]


def world_folder(root: Path, names: list[str], panoramas: int) -> Path:
    """A world of held-out bodies, each from two sides, and panoramas beside it."""
    claim_folder(root / "world", WorldSettings(0, 2, 0, len(names)))
    flat = np.full((1, 8, 8), 128, np.uint8)
    write_patterns(root / "world", Atlas(flat, np.zeros(1, np.uint8), np.zeros(1, bool)))
    for k, name in enumerate(names):
        sides = [
            replace(ellipsoid_view(np.random.default_rng(k), half), name=name)
            for half in ((0.3 + 0.02 * k, 0.4, 0.4), (0.4, 0.31 + 0.02 * k, 0.4))
        ]
        write_views(root / "world" / VIEWS / f"{k:05d}.npz", name, sides, "")
    (root / "hdri").mkdir()
    for k in range(panoramas):
        write(root / "hdri" / f"place{chr(97 + k)}.exr", (1 + k) * photo(seed=k))
    return root / "world"


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[tuple[set[str], set[int]]]:
    """The bodies and environments that were lit."""
    lit = list[tuple[set[str], set[int]]]()

    def recorded(
        world: World, split: Split, environments: np.ndarray, rng: object, side: int
    ) -> np.ndarray:
        lit.append(({one.name for one in world.views[split]}, set(environments.tolist())))
        return np.zeros((len(world.views[split]), 4, side, side), np.uint8)

    monkeypatch.setattr(held_out, "lit_cutouts", recorded)
    monkeypatch.setattr(scene_batches, "_PROCEDURAL", 0)
    return lit


@pytest.mark.slow
def test_the_parts_share_no_body_and_no_light(
    tmp_path: Path, seen: list[tuple[set[str], set[int]]]
) -> None:
    names = HELD_OUT[:7]
    world = world_folder(tmp_path, names, 12)
    made = [held_out.held_out_ingredients(world, tmp_path / "hdri", part) for part in "AB"]
    (first, light), (second, other) = seen
    assert first and second and not first & second and first | second == set(names)
    assert len(light) == len(other) == 1 and light != other
    assert not np.array_equal(made[0].panoramas, made[1].panoramas)


@pytest.mark.slow
def test_panoramas_are_held_out_whatever_the_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene_batches, "_PROCEDURAL", 0)
    world, hdri, splits = world_folder(tmp_path, HELD_OUT[:1], 12), tmp_path / "hdri", list(Split)
    found = [read_world([world], hdri, splits[1:2], seed) for seed in (0, 35)]
    first, other = (one.held_out_environments.tolist() for one in found)
    assert first == other and len(first) == 2
    assert not set(first) & set(found[1].training_environments.tolist())
    for path in sorted(hdri.iterdir())[5:]:
        path.unlink()
    with pytest.raises(InputError, match="too few panoramas"):
        read_world([world], hdri, splits[1:2], 0)


@pytest.mark.slow
def test_a_part_without_bodies_or_panoramas_is_refused(
    tmp_path: Path, seen: list[tuple[set[str], set[int]]]
) -> None:
    for folder, half, panoramas, match in (("a", 0, 12, "no held-out bodies"), ("b", 1, 6, "few")):
        (tmp_path / folder).mkdir()
        names = [name for name in HELD_OUT if half_of(name) == half][:2]
        world = world_folder(tmp_path / folder, names, panoramas)
        with pytest.raises(InputError, match=match):
            held_out.held_out_ingredients(world, tmp_path / folder / "hdri", "B")
    assert not seen
