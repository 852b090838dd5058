"""Disks that are full, read-only, or fail at any step."""

import contextlib
import errno
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from tests.faults.commands import (
    CAMPAIGN,
    COMMANDS,
    DECOMPOSE,
    MASK,
    NO_HARM,
    SEPARATE,
    Command,
    State,
    assert_refused,
    leftovers,
)
from tests.faults.conftest import Trials

if not sys.platform.startswith("linux"):
    pytest.skip("disks are made to fail by means of Linux", allow_module_level=True)
import resource

CODES = (errno.ENOSPC, errno.EROFS, errno.EIO, errno.EDQUOT, errno.EACCES)
WATCHED = ("open", "os.mkdir", "os.rename", "os.truncate", "shutil.copyfile", "shutil.move")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
SAMPLE = {MASK: 1, SEPARATE: 5, DECOMPOSE: 16}
STEPS = list((dict.fromkeys(COMMANDS, 1) if CAMPAIGN else SAMPLE).items())

some_commands = pytest.mark.parametrize(
    "command", COMMANDS if CAMPAIGN else [MASK], ids=lambda command: command.name
)


class Breaker:
    """Counts the steps that write below a folder, and fails one of them.

    Python reports the steps to an audit hook. A hook cannot be removed, so there is one for the
    process.
    """

    def __init__(self) -> None:
        self.folder, self.at, self.code, self.count = "", 0, 0, 0
        sys.addaudithook(self._audit)

    @contextlib.contextmanager
    def breaking(self, folder: Path, at: int, code: int) -> Iterator["Breaker"]:
        """Fail the `at`-th step with an error code while the block lasts."""
        self.folder, self.at, self.code, self.count = str(folder), at, code, 0
        real = os.fsync

        def flush(descriptor: int) -> None:
            self._step()
            real(descriptor)

        try:
            with mock.patch("os.fsync", flush):
                yield self
        finally:
            self.folder = ""

    def _audit(self, name: str, values: tuple[object, ...]) -> None:
        if not self.folder or name not in WATCHED:
            return
        if name == "open" and not (isinstance(values[2], int) and values[2] & WRITING):
            return
        paths = [os.fspath(value) for value in values[:2] if isinstance(value, str | os.PathLike)]
        if any(str(path).startswith(self.folder) for path in paths):
            self._step()

    def _step(self) -> None:
        self.count += 1
        if self.count == self.at:
            raise OSError(self.code, os.strerror(self.code))


@pytest.fixture(scope="module")
def breaker() -> Breaker:
    return Breaker()


@pytest.mark.slow
@pytest.mark.parametrize(("command", "each"), STEPS, ids=lambda value: getattr(value, "name", ""))
@pytest.mark.parametrize("earlier", [False, True], ids=["nothing there", "earlier output"])
def test_every_writing_step_may_fail(
    trial: Trials, breaker: Breaker, command: Command, each: int, earlier: bool
) -> None:
    this, at, failures = trial(command), 1, 0
    while True:
        this.reset(earlier)
        with breaker.breaking(this.place, at, CODES[at % len(CODES)]) as steps:
            code, text = this.run()
        failures += code != 0
        this.assert_no_harm(code, text, earlier)
        if steps.count < at:
            break
        at += each
    assert failures >= (1 if command.resumes and earlier else 2)


@pytest.mark.slow
@some_commands
def test_files_that_may_not_grow(trial: Trials, command: Command) -> None:
    """As on a disk or under a quota that is exhausted within a file."""
    this = trial(command)
    this.reset(earlier=True)
    files = [this.output] if this.output.is_file() else this.output.rglob("*")
    largest = max(path.stat().st_size for path in files)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    for size in (0, 1, 4096, *(largest * k // 12 for k in range(1, 14))):
        this.reset()
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
        try:
            code, text = this.run()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        this.assert_no_harm(code, text, earlier=False)


def mount(*words: str) -> None:
    """Mount something, or skip the test where this user may not."""
    try:
        done = subprocess.run(["mount", *words], capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        done = False
    if not done:
        pytest.skip("mounting needs rights that this user does not have")


@contextlib.contextmanager
def mounted(place: Path, *options: str) -> Iterator[None]:
    """A file system on the folder `place` while the block lasts."""
    place.mkdir(parents=True, exist_ok=True)
    mount(*options, str(place))
    try:
        yield
    finally:
        subprocess.run(["umount", str(place)], capture_output=True, check=False)


@some_commands
def test_full_disks_of_every_size(trial: Trials, command: Command) -> None:
    this, kilobytes, code = trial(command), 4, 2
    while code:
        assert kilobytes < 1 << 14, "no disk was large enough"
        this.reset()
        disk = this.place / "disk"
        with mounted(disk, "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs"):
            code, text = this.run(disk / command.output)
            state, left = this.state(disk / command.output), leftovers(disk)
        if code:
            assert_refused(code, text)
        assert state in (NO_HARM if code else (State.COMPLETE,)), f"{kilobytes} kB: {text}"
        assert left == [], f"{kilobytes} kB: {text}"
        kilobytes += max(4, kilobytes // 5)


@some_commands
@pytest.mark.parametrize("earlier", [False, True], ids=["nothing there", "earlier output"])
def test_read_only_disk(trial: Trials, command: Command, earlier: bool) -> None:
    this = trial(command)
    disk = this.place / "disk"
    disk.mkdir()
    if earlier:
        assert this.run(disk / command.output)[0] == 0
    with mounted(disk, "--bind", str(disk)):
        mount("-o", "remount,bind,ro", str(disk))
        assert_refused(*this.run(disk / command.output))
    expected = State.COMPLETE if earlier else State.ABSENT
    assert this.state(disk / command.output) is expected


def test_damage_is_detected(trial: Trials) -> None:
    this = trial(MASK)
    this.reset(earlier=True)
    assert this.state() is State.COMPLETE
    this.output.write_bytes(b"half")
    assert this.state() is State.DAMAGED and leftovers(this.place) == []
    for code, text in ((1, "Traceback"), (2, "isc: error: a\nb\n"), (0, "isc: error: why\n")):
        with pytest.raises(AssertionError):
            assert_refused(code, text)
    assert_refused(2, "isc: error: why\n")
