"""A pack gives back what was put in, as exactly as it says."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from isc_core.errors import InputError
from tests.angles import degrees_between
from tests.training.world.analytic_views import ellipsoid_view
from tests.training.world.test_environments import photo, write
from training.networks.scene_batches import read_world
from training.world.environments import Panorama
from training.world.files import (
    VIEWS as FOLDER,
)
from training.world.files import (
    Split,
    WorldSettings,
    claim_folder,
    split_of,
    views_in,
    write_patterns,
    write_views,
)
from training.world.pack import (
    PackedWorld,
    all_views,
    chosen_views,
    pack_worlds,
    read_pack,
    write_pack,
)
from training.world.patterns import Atlas

RNG = np.random.default_rng(0)
VIEWS = [
    ellipsoid_view(np.random.default_rng(k), half)
    for k, half in enumerate([(0.9, 0.9, 0.9), (0.4, 0.9, 0.8), (0.9, 0.5, 0.2)])
]
PANORAMAS = [
    Panorama(name, RNG.random((32, 64, 3)).astype(np.float16).astype(np.float32), name == "b")
    for name in ("a", "b")
]
ATLAS = Atlas(
    RNG.integers(0, 256, (5, 16, 16), np.uint8),
    np.arange(5).astype(np.uint8),
    np.array([True, False, True, False, False]),
)
WORLD = PackedWorld({Split.TRAIN: VIEWS[:2], Split.UNSEEN_BODY: VIEWS[2:]}, PANORAMAS, ATLAS)


@pytest.fixture
def pack(tmp_path: Path) -> Path:
    path = tmp_path / "world.isw"
    assert write_pack(path, WORLD) == path.stat().st_size
    return path


def test_a_pack_gives_back_its_world(pack: Path) -> None:
    found = read_pack(pack)
    assert [len(found.views[split]) for split in Split] == [2, 1, 0]
    for seen, view in zip(
        [*found.views[Split.TRAIN], *found.views[Split.UNSEEN_BODY]], VIEWS, strict=True
    ):
        assert (seen.name, seen.source, seen.distance) == (view.name, view.source, view.distance)
        for exact in ("mask", "visible", "directions"):
            np.testing.assert_array_equal(getattr(seen, exact), getattr(view, exact))
        assert degrees_between(seen.normal, view.normal).max() < 1
        assert np.abs(seen.depth.astype(float) - view.depth).max() < 0.002
        assert np.abs(seen.thickness.astype(float) - view.thickness).max() < 0.012
    for seen_light, light in zip(found.panoramas, PANORAMAS, strict=True):
        assert (seen_light.name, seen_light.held_out) == (light.name, light.held_out)
        np.testing.assert_array_equal(seen_light.radiance, light.radiance)
    for part in ("maps", "kinds", "tileable"):
        np.testing.assert_array_equal(getattr(found.atlas, part), getattr(ATLAS, part))


@pytest.mark.parametrize("kept", [0, 10, 3000])
def test_a_truncated_pack_is_refused_in_one_line(pack: Path, kept: int) -> None:
    pack.write_bytes(pack.read_bytes()[:kept])
    with pytest.raises(InputError, match="is damaged or not a pack of a world") as error:
        read_pack(pack)
    assert "\n" not in str(error.value)


def test_a_pack_of_another_version_is_refused(pack: Path) -> None:
    with np.load(pack) as data:
        arrays = {**data, "format": np.array(99)}
    with pack.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="another version"):
        read_pack(pack)


def test_every_body_is_chosen_once_before_any_is_chosen_twice() -> None:
    views = [replace(VIEWS[0], name=name) for name in ("a", "a", "a", "b", "b", "c")]
    rng = np.random.default_rng(0)
    assert sorted(one.name for one in chosen_views(views, 3, rng)) == ["a", "b", "c"]
    assert sorted(one.name for one in chosen_views(views, 5, rng)) == ["a", "a", "b", "b", "c"]
    assert len(chosen_views(views, 9, rng)) == 6


def world_folder(root: Path) -> Path:
    """A world of bodies to learn from and of held-out ones, and panoramas beside it."""
    claim_folder(root / "world", WorldSettings(0, 1, 0, 0))
    write_patterns(root / "world", ATLAS)
    for k in range(24):
        view = replace(VIEWS[k % 3], name=f"family/ball/{k:04d}")
        write_views(root / "world" / FOLDER / f"{k:05d}.npz", view.name, [view], "")
    (root / "hdri").mkdir()
    for k in range(6):
        write(root / "hdri" / f"place{k}.exr", photo(seed=k))
    return root / "world"


@pytest.mark.slow
def test_worlds_are_packed_into_the_bytes_that_are_allowed(tmp_path: Path) -> None:
    world, path = world_folder(tmp_path), tmp_path / "world.isw"
    most = 400_000
    (line,) = pack_worlds([world], tmp_path / "hdri", path, most, seed=0)
    assert path.stat().st_size <= most and str(path) in line
    found = read_pack(path)
    assert len(found.views[Split.TRAIN]) > len(found.views[Split.UNSEEN_BODY]) > 0
    assert all(split_of(one.name) == split for split in Split for one in found.views[split])
    assert sum(one.held_out for one in found.panoramas) == 1


def test_bodies_that_are_packed_come_last() -> None:
    views = [replace(VIEWS[0], name=name) for name in ("a", "a", "b", "c")]
    chosen = chosen_views(views, 2, np.random.default_rng(0), [views[0]])
    assert sorted(one.name for one in chosen) == ["b", "c"]


@pytest.mark.slow
def test_a_second_pack_contains_other_views_than_the_first(tmp_path: Path) -> None:
    world, second = world_folder(tmp_path), tmp_path / "b.isw"
    first = [view for split in Split for view in views_in(world, split)][::2]
    pack_worlds([world], tmp_path / "hdri", second, 10**8, 0, first)
    names = {one.name for one in all_views(second)}
    assert len(names) == 24 - len(first) and not names & {one.name for one in first}
    everything = [*first, *all_views(second)]
    with pytest.raises(InputError, match="no views that other packs do not hold"):
        pack_worlds([world], tmp_path / "hdri", tmp_path / "c.isw", 10**8, 0, everything)


@pytest.mark.slow
def test_too_few_bytes_for_a_pack_are_refused_and_leave_nothing(tmp_path: Path) -> None:
    world, path = world_folder(tmp_path), tmp_path / "world.isw"
    with pytest.raises(InputError, match="too few"):
        pack_worlds([world], tmp_path / "hdri", path, 10_000, seed=0)
    assert not path.exists()


@pytest.mark.slow
def test_a_fit_reads_a_pack_as_it_reads_a_folder(tmp_path: Path) -> None:
    world, path = world_folder(tmp_path), tmp_path / "world.isw"
    pack_worlds([world], tmp_path / "hdri", path, 10**8, seed=0)
    splits = (Split.TRAIN, Split.UNSEEN_BODY)
    packed = read_world([path], None, splits, 0)
    plain = read_world([world], tmp_path / "hdri", splits, 0)
    assert {s: len(v) for s, v in packed.views.items()} == {
        s: len(v) for s, v in plain.views.items()
    }
    assert packed.bank.maps.shape == plain.bank.maps.shape
    with pytest.raises(InputError, match="--panoramas"):
        read_world([world], None, splits, 0)
