"""The checkpoint of a run: stages in a hidden folder beside its output, until that is complete."""

from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import Cancelled
from isc_core.io.checkpoint import Checkpoint

MADE = {"x": np.arange(3.0)}


def computed(checkpoint: Checkpoint, *inputs: float) -> bool:
    """Whether a stage is computed."""
    calls = list[int]()

    def compute() -> dict[str, np.ndarray]:
        calls.append(1)
        return MADE

    found = checkpoint.arrays("fit", [np.array(value) for value in inputs], compute)
    assert found["x"].tobytes() == MADE["x"].tobytes()
    return bool(calls)


def test_the_next_run_has_the_stages_until_the_output_is_complete(tmp_path: Path) -> None:
    output = tmp_path / "new" / "cup"
    first = Checkpoint(output)
    assert not output.parent.exists()
    assert computed(first, 1) and computed(first, 2) and first.notes() == []
    second = Checkpoint(output)
    assert second.folder == first.folder == output.with_name(".cup.checkpoint")
    assert not computed(second, 1) and not computed(second, 2) and computed(second, 3)
    assert second.notes() == ["continued an interrupted run"]
    second.remove()
    assert list(output.parent.iterdir()) == []
    assert computed(Checkpoint(output), 1)


def test_another_output_has_its_own(tmp_path: Path) -> None:
    assert computed(Checkpoint(tmp_path / "a"), 1) and computed(Checkpoint(tmp_path / "b"), 1)


def test_what_cannot_be_used_is_said_and_removed(tmp_path: Path) -> None:
    first = Checkpoint(tmp_path / "cup")
    computed(first, 1)
    (file,) = first.folder.iterdir()
    computed(first, 2)
    file.write_bytes(b"PK")
    second = Checkpoint(tmp_path / "cup")
    assert computed(second, 1) and not computed(second, 2)
    continued, note = second.notes()
    assert continued.startswith("continued") and note.startswith("note: 1 kept stage was not used")
    second.remove()
    assert not second.folder.exists()


def test_foreign_files_stay_and_those_of_killed_processes_go(tmp_path: Path) -> None:
    checkpoint = Checkpoint(tmp_path / "cup")
    computed(checkpoint, 1)
    (file,) = checkpoint.folder.iterdir()
    (checkpoint.folder / f".{file.name}.00000000.partial").touch()
    (checkpoint.folder / "mine.txt").touch()
    checkpoint.remove()
    assert [path.name for path in checkpoint.folder.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("name", ["cup", "x" * 250])
def test_a_place_that_cannot_be_written_changes_nothing(tmp_path: Path, name: str) -> None:
    if name == "cup":
        (tmp_path / ".cup.checkpoint").touch()
    checkpoint = Checkpoint(tmp_path / name)
    assert computed(checkpoint, 1) and computed(checkpoint, 1) and checkpoint.notes() == []
    assert not notes_of_stopped(checkpoint, Cancelled())
    checkpoint.remove()


@pytest.mark.parametrize("stop", [Cancelled(), KeyboardInterrupt()])
def test_a_stopped_run_says_what_is_kept(tmp_path: Path, stop: BaseException) -> None:
    checkpoint = Checkpoint(tmp_path / "cup\n")
    assert not notes_of_stopped(checkpoint, stop), "nothing is kept yet"
    computed(checkpoint, 1)
    (note,) = notes_of_stopped(checkpoint, stop)
    assert f"{tmp_path}/.cup\\n.checkpoint: repeat the command" in note


def notes_of_stopped(checkpoint: Checkpoint, stop: BaseException) -> list[str]:
    with pytest.raises(type(stop)) as stopped, checkpoint:
        raise stop
    return getattr(stopped.value, "__notes__", [])
