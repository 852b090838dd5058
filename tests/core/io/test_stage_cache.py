"""Stages kept for the next run: the result is that of the stage, whatever the folder holds."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from isc_core.io import stage_cache
from isc_core.io.source_stamp import source_stamp
from isc_core.io.stage_cache import Arrays, StageCache

INPUT = np.arange(6, dtype=np.float32).reshape(2, 3)
MADE = {
    "maps": np.array([[0.1, -0.0], [np.nan, 3e-320]]),
    "mask": np.array([True, False, True]),
    "share": np.array(0.3),
    "outcome": np.array("no flanks"),
}
AGAIN = {"maps": np.array([7.0])}


def same(one: Arrays, other: Arrays) -> bool:
    """Whether the arrays have the same names, types, shapes and bytes."""
    return {name: (a.dtype, a.shape, a.tobytes()) for name, a in one.items()} == {
        name: (a.dtype, a.shape, a.tobytes()) for name, a in other.items()
    }


def kept(folder: Path, stage: str = "network", *inputs: np.ndarray) -> Arrays:
    """What the folder gives: `MADE` if it has it, else `AGAIN`."""
    return StageCache(folder).arrays(stage, inputs or (INPUT,), lambda: AGAIN)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with one stage in it."""
    cache = StageCache(tmp_path / "kept")
    assert same(cache.arrays("network", (INPUT,), lambda: MADE), MADE)
    return cache.folder


def file_of(folder: Path) -> Path:
    (file,) = folder.iterdir()
    return file


def test_a_stage_is_computed_once(folder: Path) -> None:
    os.utime(file_of(folder), (1, 1))
    assert same(kept(folder), MADE)
    assert file_of(folder).stat().st_mtime > 1, "the owner of the folder sees that it was used"


def test_everything_it_depends_on_counts(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changed = INPUT.copy()
    changed[1, 2] = np.nextafter(changed[1, 2], np.float32(9))
    assert same(kept(folder, "network", changed), AGAIN), "one bit of the input"
    assert same(kept(folder, "network", INPUT.reshape(3, 2)), AGAIN), "its shape"
    assert same(kept(folder, "network", INPUT.view(np.int32)), AGAIN), "its type"
    assert same(kept(folder, "network", INPUT, INPUT), AGAIN), "another input"
    assert same(kept(folder, "light colour"), AGAIN), "the stage"
    monkeypatch.setattr(stage_cache, "_program", lambda: b"of another version")
    assert same(kept(folder), AGAIN), "the program"


def test_the_stamp_is_of_names_sizes_and_dates(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("1")
    os.utime(tmp_path / "a.py", (5, 5))
    stamps = [source_stamp(tmp_path)]
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "a.pyc").write_text("bytecode")
    assert source_stamp(tmp_path) == stamps[0]
    os.utime(tmp_path / "a.py", (6, 6))
    stamps.append(source_stamp(tmp_path))
    (tmp_path / "a.py").rename(tmp_path / "b.py")
    stamps.append(source_stamp(tmp_path))
    assert len(set(stamps)) == 3


def test_a_damaged_file_is_never_used(folder: Path) -> None:
    """Bytes are flipped: either the arrays are intact, or the stage is computed again."""
    file = file_of(folder)
    intact, used = file.read_bytes(), 0
    places = range(0, len(intact), 29)
    for at in places:
        damaged = bytearray(intact)
        damaged[at] ^= 0xFF
        file.write_bytes(damaged)
        found = kept(folder)
        assert same(found, MADE) or same(found, AGAIN), at
        used += same(found, MADE)
    assert used < len(places) / 2
    file.write_bytes(intact[:-30])
    assert same(kept(folder), AGAIN), "cut short"
    assert same(kept(folder), AGAIN), "and replaced by what was computed"


def test_a_file_of_another_stage_is_not_used(folder: Path) -> None:
    file = file_of(folder)
    content = file.read_bytes()
    file.unlink()
    kept(folder, "other")
    other = file_of(folder)
    other.write_bytes(content)
    assert same(kept(folder, "other"), AGAIN)
    shutil.copy(other, file)
    assert same(kept(folder), AGAIN)


def test_a_folder_that_cannot_be_written_does_not_stop_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    assert same(kept(tmp_path / "file"), AGAIN)
    assert (tmp_path / "file").read_text() == "no folder"
