"""The folder of a world: what is written is read, and what is damaged is refused in one line."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from isc_core.errors import InputError
from tests.training.world.analytic_views import ellipsoid_view
from training.world.files import (
    SETTINGS,
    VIEWS,
    Split,
    WorldSettings,
    claim_folder,
    read_patterns,
    read_views,
    split_of,
    views_in,
    write_patterns,
    write_views,
)
from training.world.patterns import Atlas
from training.world.views import View

SETTINGS_OF_ALL = WorldSettings(seed=3, views=2, built=0, families=2)


def some_views() -> list[View]:
    rng = np.random.default_rng(0)
    near = replace(ellipsoid_view(rng, (0.9, 0.3, 0.2)), name="near", distance=3.5)
    return [ellipsoid_view(rng, (0.2, 0.9, 0.2)), near]


def everything(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def refused(path: Path, match: str) -> None:
    with pytest.raises(InputError, match=match) as caught:
        read_views(path)
    assert path.name in str(caught.value) and "\n" not in str(caught.value)


def test_views_are_read_as_written(tmp_path: Path) -> None:
    path = tmp_path / "00000.npz"
    write_views(path, "made/one", some_views(), "")
    reference, views = read_views(path)
    assert reference == "made/one"
    for view, wanted in zip(views, some_views(), strict=True):
        for field in fields(View):
            value = getattr(view, field.name)
            np.testing.assert_array_equal(value, getattr(wanted, field.name))
            assert np.asarray(value).dtype == np.asarray(getattr(wanted, field.name)).dtype
    before = path.read_bytes()
    write_views(path, "made/one", some_views(), "")
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_a_reference_may_have_no_views(tmp_path: Path) -> None:
    write_views(tmp_path / "00000.npz", "scan/cat", [], "no side shows enough")
    assert read_views(tmp_path / "00000.npz") == ("scan/cat", [])


def test_damaged_archives_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "00000.npz"
    write_views(path, "made/one", some_views(), "")
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    for damaged in (b"", b"no archive", whole[: len(whole) // 2], whole[:-20]):
        path.write_bytes(damaged)
        refused(path, "not an archive of views")
    for place in rng.integers(200, len(whole) - 2000, 20):
        path.write_bytes(whole[:place] + rng.bytes(40) + whole[place + 40 :])
        refused(path, "not an archive of views")
    with path.open("wb") as file:
        np.save(file, np.zeros(3))
    refused(path, "not an archive of views")
    refused(tmp_path / "absent.npz", r"cannot be read \(No such file or directory\)")


@pytest.mark.parametrize(
    "part", ["mask", "normal", "depth", "thickness", "visible", "directions", "up"]
)
def test_views_of_another_shape_are_refused(tmp_path: Path, part: str) -> None:
    path = tmp_path / "00000.npz"
    first = some_views()[0]
    other = replace(first, **{part: getattr(first, part)[:-1]})
    write_views(path, "made/one", [other], "")
    refused(path, "views of another shape: delete it")
    with np.load(path) as data:
        parts = dict(data)
    del parts[f"{part}0"]
    np.savez(path, **parts)
    refused(path, "is damaged or not an archive of views: delete it")


def test_a_folder_is_claimed_once_and_by_the_same_settings_only(tmp_path: Path) -> None:
    folder = tmp_path / "world"
    claim_folder(folder, SETTINGS_OF_ALL)
    claim_folder(folder, SETTINGS_OF_ALL)
    before = everything(folder)
    for name in ("seed", "views", "built", "families"):
        with pytest.raises(InputError, match="holds a world of other settings") as caught:
            claim_folder(folder, replace(SETTINGS_OF_ALL, **{name: 9}))
        assert "\n" not in str(caught.value)
    assert everything(folder) == before
    (folder / SETTINGS).write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        claim_folder(folder, SETTINGS_OF_ALL)
    (folder / SETTINGS).write_text(json.dumps({"format": 99}))
    with pytest.raises(InputError, match="another version: build a new one"):
        claim_folder(folder, SETTINGS_OF_ALL)
    with pytest.raises(InputError, match="another version: build a new one"):
        list(views_in(folder, Split.TRAIN))


def test_folders_and_files_that_are_no_world_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    for place in (tmp_path, tmp_path / "letter.txt"):
        with pytest.raises(InputError, match="no world"):
            claim_folder(place, SETTINGS_OF_ALL)
        with pytest.raises(InputError, match="no world"):
            list(views_in(place, Split.TRAIN))
    assert everything(tmp_path) == {"letter.txt": b"dear"}


def test_each_reference_is_in_one_set(tmp_path: Path) -> None:
    claim_folder(tmp_path, SETTINGS_OF_ALL)
    names = [f"family/blobby/{k:04d}" for k in range(30)] + ["scan/cat", "scan/dog"]
    for k, name in enumerate(names):
        view = replace(some_views()[0], name=name)
        write_views(tmp_path / VIEWS / f"{k:05d}.npz", name, [view], "")
    found = {split: [view.name for view in views_in(tmp_path, split)] for split in Split}
    assert sorted(name for part in found.values() for name in part) == sorted(names)
    assert found[Split.UNSEEN_SOURCE] == ["scan/cat", "scan/dog"]
    assert 0 < len(found[Split.UNSEEN_BODY]) < 10
    for split, part in found.items():
        assert part == [name for name in names if split_of(name) == split]


def test_one_reference_in_eight_is_held_out() -> None:
    names = [f"family/lathe/{k:04d}" for k in range(2000)]
    share = sum(split_of(name) == Split.UNSEEN_BODY for name in names) / len(names)
    assert share == pytest.approx(1 / 8, abs=0.02)


def test_patterns_are_read_as_written_and_refused_when_damaged(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    grey = rng.integers(0, 256, (4, 8, 8)).astype(np.uint8)
    atlas = Atlas(grey, np.arange(4).astype(np.uint8), np.array([True, False, True, False]))
    write_patterns(tmp_path, atlas)
    found = read_patterns(tmp_path)
    for name in ("maps", "kinds", "tileable"):
        np.testing.assert_array_equal(getattr(found, name), getattr(atlas, name))
    path = next(tmp_path.iterdir())
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(InputError, match="is damaged or not an archive of patterns: delete it"):
        read_patterns(tmp_path)
    path.unlink()
    with pytest.raises(InputError, match="cannot be read"):
        read_patterns(tmp_path)
