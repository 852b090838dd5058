"""Earlier results: found by their content, limited in size, and never trusted when damaged."""

import hashlib
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.datablocks.staging import run_to_end  # noqa: E402 (after the skip)
from blender_addon.files.image_source import ImageSource  # noqa: E402
from blender_addon.files.result_cache import ResultCache, content_key  # noqa: E402
from blender_addon.runs import run_steps  # noqa: E402
from blender_addon.runs.request import MethodSettings  # noqa: E402
from blender_addon.runs.run_steps import ResultDestination, decompose_steps  # noqa: E402
from blender_addon.runs.worker_run import RunOutput  # noqa: E402
from blender_addon.worker.commands import DecomposeJob, WorkerEnvironment  # noqa: E402
from blender_addon.worker.process import WorkerState, WorkerUpdate  # noqa: E402


@pytest.fixture
def core(tmp_path: Path) -> Path:
    """A folder in place of the package that makes results."""
    (tmp_path / "search" / "isc_core").mkdir(parents=True)
    (tmp_path / "search" / "isc_core" / "solver.py").write_text("1")
    return tmp_path / "search" / "isc_core"


def file(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def test_the_key_depends_on_content_settings_and_core(tmp_path: Path, core: Path) -> None:
    photo, mask = file(tmp_path / "cup.png", "photo"), file(tmp_path / "mask.png", "mask")
    usual = content_key((photo, mask), ("isc", 512), core)
    assert usual == content_key((photo, mask), ("isc", 512), core)
    elsewhere = shutil.copy(photo, file(tmp_path / "other" / "jug.png", ""))
    assert usual == content_key((Path(elsewhere), mask), ("isc", 512), core), "names do not count"
    others = [
        content_key((photo, None), ("isc", 512), core),
        content_key((photo, mask), ("isc", 256), core),
        content_key((file(tmp_path / "b" / "cup.png", "photo!"), mask), ("isc", 512), core),
    ]
    (core / "solver.py").write_text("12")
    others.append(content_key((photo, mask), ("isc", 512), core))
    assert len({usual, *others}) == 5


def test_a_result_is_read_and_a_damaged_one_removed(tmp_path: Path, bump_folder: Path) -> None:
    cache = ResultCache(tmp_path / "cache", 1 << 30)
    assert cache.read("a") is None, "there is none"
    place = shutil.copytree(bump_folder, cache.place("a"))
    found = cache.read("a")
    assert found is not None and found.folder == place
    arrays = place / "arrays.npz"
    content = bytearray(arrays.read_bytes())
    content[len(content) // 2] ^= 0xFF  # one flipped byte in the middle of an array
    arrays.write_bytes(content)
    assert cache.read("a") is None and not place.exists()


def test_a_result_that_another_blender_has_stored_is_kept(tmp_path: Path) -> None:
    cache = ResultCache(tmp_path / "cache", 1 << 30)
    for made in ("first", "second"):
        file(tmp_path / made / "1" / "arrays.npz", made)
        cache.store("a", tmp_path / made)
    assert (cache.place("a") / "1" / "arrays.npz").read_text() == "first"
    assert [entry.name for entry in cache.folder.iterdir()] == ["a"]
    assert not (tmp_path / "second").exists()


def keyed(name: str) -> str:
    """A name as the cache has it: a key, and the suffix of `name`."""
    return hashlib.sha256(name.encode()).hexdigest() + Path(name).suffix


def aged(folder: Path, *names: str) -> None:
    """Make entries of 100 bytes, the first the last used: files of stages, or results."""
    for age, name in enumerate(names):
        entry = folder / name
        file(entry if entry.suffix else entry / "arrays.npz", 100 * "x")
        os.utime(entry, (1e9 - age, 1e9 - age))


def test_what_was_not_used_for_the_longest_time_goes_first(tmp_path: Path) -> None:
    new, old, oldest = map(keyed, ("new", "old", "oldest"))
    aged(tmp_path, new, old, oldest)
    ResultCache(tmp_path, 250).trim(oldest)
    assert {entry.name for entry in tmp_path.iterdir()} == {new, oldest}


def test_stages_of_the_worker_count_and_go_like_results(tmp_path: Path) -> None:
    names = [keyed(name) for name in ("new", "used.npz", "old", "oldest.npz")]
    aged(tmp_path, *names)
    ResultCache(tmp_path, 250).trim(names[0])
    assert {entry.name for entry in tmp_path.iterdir()} == set(names[:2])


def test_other_files_of_a_chosen_folder_stay(tmp_path: Path) -> None:
    """The user may choose any folder: its folders and arrays were removed like results."""
    new, old = map(keyed, ("new", "old"))
    aged(tmp_path, new, "holiday", "scan.npz", "notes.txt", old)
    ResultCache(tmp_path, 100).trim(new)
    assert {entry.name for entry in tmp_path.iterdir()} == {
        new,
        "holiday",
        "scan.npz",
        "notes.txt",
    }


class Done:
    """A worker that has written its result."""

    def poll(self) -> WorkerUpdate:
        return WorkerUpdate("done", 1.0, WorkerState.DONE)

    def kill(self) -> None:
        """Nothing to end."""


@pytest.mark.parametrize("keep", [False, True])
def test_a_second_run_starts_no_worker(
    tmp_path: Path, core: Path, bump_folder: Path, monkeypatch: pytest.MonkeyPatch, keep: bool
) -> None:
    jobs: list[DecomposeJob] = []

    def start(job: DecomposeJob, environment: Any) -> Done:
        jobs.append(job)
        shutil.copytree(bump_folder, job.output)
        return Done()

    monkeypatch.setattr(run_steps, "start_decompose", start)
    photo = ImageSource("cup", path=file(tmp_path / "cup.png", "photo"))
    environment = WorkerEnvironment(Path("python"), (core.parent,), tmp_path / "kernels")
    cache = ResultCache(tmp_path / "cache", 1 << 30)

    def run(number: int, method: MethodSettings) -> RunOutput:
        place = ResultDestination(tmp_path / str(number), cache, keep)
        return run_to_end(decompose_steps(photo, None, None, method, place, 0, environment))

    outputs = [run(n, MethodSettings(samples=n)) for n in range(2)]
    assert len(jobs) == 1, "how it is rendered does not count"
    assert all(output.prepared for output in outputs)
    assert outputs[1].path == (tmp_path / "1" / "result" if keep else outputs[0].path)
    assert not keep or (outputs[1].path / "decomposition.json").is_file()
    assert jobs[0].cache == cache.folder, "what the separator does not change is kept there, too"
    run(2, MethodSettings(separator="none"))
    assert len(jobs) == 2, "another separator is another result"
    run(3, MethodSettings(separator="none", refine=True))
    assert len(jobs) == 3, "and so is refined gloss"
