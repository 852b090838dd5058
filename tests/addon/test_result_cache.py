"""Earlier results: found by their content, limited in size, and never trusted when damaged."""

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


def test_what_was_not_used_for_the_longest_time_goes_first(tmp_path: Path) -> None:
    cache = ResultCache(tmp_path, 250)
    for age, name in enumerate(("new", "old", "oldest")):
        file(tmp_path / name / "arrays.npz", 100 * "x")
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    cache.trim("oldest")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["new", "oldest"]


def test_stages_of_the_worker_count_and_go_like_results(tmp_path: Path) -> None:
    cache = ResultCache(tmp_path, 250)
    for age, name in enumerate(("new/arrays.npz", "used.npz", "old/arrays.npz", "oldest.npz")):
        entry = tmp_path / file(tmp_path / name, 100 * "x").relative_to(tmp_path).parts[0]
        os.utime(entry, (1e9 - age, 1e9 - age))
    file(tmp_path / "notes.txt", 100 * "x")
    cache.trim("new")
    left = sorted(entry.name for entry in tmp_path.iterdir())
    assert left == ["new", "notes.txt", "used.npz"]


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
