"""Several processes write at once, or are killed: one complete result, and no leftovers."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from isc_core.errors import InputError
from isc_core.io import temporary_siblings
from isc_core.io.atomic import new_file, new_folder, remove_unfinished, unfinished

ROOT = Path(__file__).resolve().parents[2]
OURS = ("mark.json", "data.bin")
KILLED = """
import ctypes, os, signal, sys
from isc_core.io.atomic import new_file, new_folder
{before}
with {kind}(sys.argv[1]{ours}) as partial:
    (partial / "mark.json" if partial.is_dir() else partial).write_text("half")
    {inside}
"""
KILL = "os.kill(os.getpid(), signal.SIGKILL)"

posix = pytest.mark.skipif(sys.platform == "win32", reason="needs file locks and signals")


def make(folder: Path, content: str) -> None:
    """Write a result of two files."""
    with new_folder(folder, OURS) as partial:
        for name in OURS:
            (partial / name).write_text(content)


def assert_holds(target: Path, content: str) -> None:
    """Assert that the result holds one content, and that nothing else is in its parent."""
    assert {(target / name).read_text() for name in OURS} == {content}
    assert [path.name for path in target.parent.iterdir()] == [target.name]


def killed(target: Path, *, kind: str = "new_folder", before: str = "", inside: str = KILL) -> None:
    """Kill a process by force while it writes `target`."""
    ours = f", {OURS!r}" if kind == "new_folder" else ""
    script = KILLED.format(kind=kind, before=before, inside=inside, ours=ours)
    words = [sys.executable, "-c", script, str(target)]
    assert subprocess.run(words, cwd=ROOT, check=False, timeout=60).returncode == -signal.SIGKILL


@posix
def test_leftovers_of_a_killed_process_are_removed_by_the_next(tmp_path: Path) -> None:
    target = tmp_path / "out"
    make(target, "old")
    killed(target)
    assert len(unfinished(target)) == 1 and (target / "mark.json").read_text() == "old"
    make(target, "new")
    assert_holds(target, "new")


@posix
def test_the_same_for_a_file(tmp_path: Path) -> None:
    target = tmp_path / "table.json"
    killed(target, kind="new_file")
    assert len(unfinished(target)) == 1 and not target.exists()
    with new_file(target) as partial:
        partial.write_text("new")
    assert target.read_text() == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["table.json"]


@posix
def test_kill_between_two_renames_loses_nothing(tmp_path: Path) -> None:
    """Where the system cannot exchange two names in one step."""
    target = tmp_path / "out"
    make(target, "old")
    before = f"""
ctypes.CDLL = lambda name, **options: object()  # without renameat2
real = os.replace
def replace(source, target):
    real(source, target)
    if str(target).endswith(".old"):
        {KILL}
os.replace = replace
"""
    killed(target, before=before, inside="(partial / 'data.bin').write_text('half')")
    assert not target.exists()
    assert {path.suffix for path in unfinished(target)} == {".old", ".partial"}
    with pytest.raises(ZeroDivisionError), new_folder(target, OURS):
        raise ZeroDivisionError  # the old result is back whatever happens to the next writer
    assert_holds(target, "old")


@posix
def test_leftovers_inside_a_result_do_not_prevent_its_replacement(tmp_path: Path) -> None:
    """`isc arrays` writes one file into a result; if killed, it leaves a temporary one there."""
    target = tmp_path / "out"
    make(target, "old")
    killed(target / "data.bin", kind="new_file")
    assert len(unfinished(target / "data.bin")) == 1
    make(target, "new")
    assert sorted(path.name for path in target.iterdir()) == ["data.bin", "mark.json"]


def test_last_writer_to_end_wins(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with new_folder(target, OURS) as first:
        for name in OURS:
            (first / name).write_text("first")
        make(target, "second")
        assert first.is_dir() and (target / "mark.json").read_text() == "second"
    assert_holds(target, "first")


@posix
@pytest.mark.parametrize(("locks", "kept"), [(True, "new"), (False, "old")])
def test_cleaning_up_during_a_write_never_spoils_a_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, locks: bool, kept: str
) -> None:
    """A batch begins while a worker of a killed one finishes its last image; removal is slow."""
    target, begun = tmp_path / "out", []
    make(target, "old")
    if not locks:
        monkeypatch.setattr(temporary_siblings, "fcntl", None)

    def remove_later(entry: Path, **options: object) -> None:
        begun.append((entry, os.open(entry, os.O_RDONLY)))

    with suppress(InputError), new_folder(target, OURS) as partial:
        for name in OURS:
            (partial / name).write_text("new")
        with monkeypatch.context() as patched:
            patched.setattr("shutil.rmtree", remove_later)
            remove_unfinished(target)
    for entry, descriptor in begun:
        for name in OURS:
            os.unlink(name, dir_fd=descriptor)
        os.close(descriptor)
        entry.rmdir()
    assert len(begun) == (not locks)
    assert_holds(target, kept)


def hammered(write: Callable[[str], None], read: Callable[[], set[str]]) -> list[str]:
    """Four threads write at once and one reads; return incomplete readings and refusals."""
    trouble: list[str] = []
    done = threading.Event()

    def writer(name: str) -> None:
        for number in range(12):
            try:
                write(f"{name}{number}")
            except InputError as error:
                trouble.append(str(error))

    def reader() -> None:
        while not done.is_set():
            with suppress(FileNotFoundError):  # a folder may be replaced between two readings
                seen = read()
                if len(seen) != 1:
                    trouble.append(f"half: {seen}")

    with ThreadPoolExecutor(5) as pool:
        reading = pool.submit(reader)
        for future in [pool.submit(writer, name) for name in "abcd"]:
            future.result()
        done.set()
        reading.result()
    return trouble


def test_many_writers_of_one_folder_all_succeed(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "out"

    def read() -> set[str]:
        descriptor = os.open(target, os.O_RDONLY)  # this folder, whatever has the name meanwhile
        try:
            names = [os.open(name, os.O_RDONLY, dir_fd=descriptor) for name in OURS]
        finally:
            os.close(descriptor)
        texts = set()
        for name in names:
            with open(name) as file:
                texts.add(file.read())
        return texts

    if os.open not in os.supports_dir_fd or not hasattr(ctypes.CDLL(None), "renameat2"):
        pytest.skip("needs folders that can be held open and exchanged")
    assert hammered(lambda text: make(target, text), read) == []
    assert [path.name for path in target.parent.iterdir()] == ["out"]


def test_many_writers_of_one_file_all_succeed(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "table.json"

    def write(text: str) -> None:
        with new_file(target) as partial:
            partial.write_text(50 * f"{text} ")

    assert hammered(write, lambda: set(target.read_text().split())) == []
    assert [path.name for path in target.parent.iterdir()] == ["table.json"]


def test_replacement_in_two_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda name, **options: object())  # without renameat2
    make(tmp_path / "out", "old")
    make(tmp_path / "out", "new")
    assert_holds(tmp_path / "out", "new")


def test_disk_without_locks_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(temporary_siblings, "fcntl", None)
    with suppress(ZeroDivisionError), new_folder(tmp_path / "out", OURS) as partial:
        name = partial.name
        raise ZeroDivisionError
    (tmp_path / name).mkdir()
    make(tmp_path / "out", "old")
    make(tmp_path / "out", "new")
    assert (tmp_path / "out" / "mark.json").read_text() == "new"
    assert len(unfinished(tmp_path / "out")) == 1, "it may belong to a living process"


@pytest.mark.parametrize("length", [200, 240, 255])
def test_name_may_be_as_long_as_the_file_system_allows(tmp_path: Path, length: int) -> None:
    name = "n" * length
    make(tmp_path / name, "new")
    with new_file(tmp_path / name / name) as partial:
        partial.write_text("long")
    assert (tmp_path / name / name).read_text() == "long"
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_device_is_never_replaced() -> None:
    if not Path("/dev/null").exists():
        pytest.skip("there are no devices here")
    with pytest.raises(InputError, match="not a regular file"), new_file("/dev/null"):
        pass
    assert Path("/dev/null").is_char_device()


def test_disk_that_is_full_only_at_the_flush(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Network disks and quotas report only then that there is no room."""

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    make(tmp_path / "out", "old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="no space is left"):
        make(tmp_path / "out", "new")
    assert_holds(tmp_path / "out", "old")
