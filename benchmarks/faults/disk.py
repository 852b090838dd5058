"""Disks that are full, read-only, or fail at any step."""

import contextlib
import errno
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest import mock

from .commands import COMMANDS, Command, digests, leftovers, one_line, run, state

CODES = (errno.ENOSPC, errno.EROFS, errno.EIO, errno.EDQUOT, errno.EACCES)
_WATCHED = ("open", "os.mkdir", "os.rename", "os.truncate", "shutil.copyfile", "shutil.move")
_CHANGING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Breaker:
    """Fails the `at`-th step that would change something below `folder`, with an error code; counts
    all of them. Python tells of every step by an audit hook, which cannot be taken away again: one
    for the process.
    """

    _hooked: "Breaker | None" = None

    def __init__(self) -> None:
        self.folder, self.at, self.code, self.count = "", 0, 0, 0

    @classmethod
    def installed(cls) -> "Breaker":
        """The process's own."""
        if cls._hooked is None:
            cls._hooked = cls()
            sys.addaudithook(cls._hooked._audit)
        return cls._hooked

    @contextlib.contextmanager
    def breaking(self, folder: Path, at: int, code: int) -> Iterator["Breaker"]:
        """Watches while the block lasts; 0 breaks nothing."""
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

    def _audit(self, event: str, words: tuple[object, ...]) -> None:
        if not self.folder or event not in _WATCHED:
            return
        if event == "open" and not (isinstance(words[2], int) and words[2] & _CHANGING):
            return
        if any(
            isinstance(word, str | os.PathLike) and os.fspath(word).startswith(self.folder)
            for word in words[:2]
        ):
            self._step()

    def _step(self) -> None:
        self.count += 1
        if self.count == self.at:
            raise OSError(self.code, os.strerror(self.code))


def broken_steps(
    command: Command, inputs: Path, place: Path, whole: dict[str, str], earlier: bool, each: int = 1
) -> list[str]:
    """One run for each step that writes, failing there, until one succeeds: what was wrong after
    it. With `earlier`, a whole output stands there before. `each`: only every so many steps.
    """
    found: list[str] = []
    breaker, output, at = Breaker.installed(), place / command.output, 1 - each
    while True:
        at += each
        fresh(place)
        if earlier:
            run(command.line(inputs, output))
        with breaker.breaking(place, at, CODES[at % len(CODES)]) as step:
            code, _, text = run(command.line(inputs, output))
        found.append(
            _after(
                command,
                inputs,
                place,
                whole,
                code,
                text,
                ("whole",) if earlier else ("nothing", "some scenes, each whole"),
            )
        )
        if step.count < at:
            return found


def _after(
    command: Command,
    inputs: Path,
    place: Path,
    whole: dict[str, str],
    code: int,
    text: str,
    allowed: tuple[str, ...],
) -> str:
    """ "" if the command ended as it should: a whole output, or a refusal that left what was there;
    then the same once more.
    """
    output = place / command.output
    seen = state(command, output, whole)
    if code == 0:
        trouble = "" if seen == "whole" else f"exit 0, but {seen}"
    else:
        trouble = one_line(code, text) or (
            "" if seen in (*allowed, "whole") else f"WRONG: after a refusal {seen}"
        )
    left = leftovers(place)
    again, _, said = run(command.line(inputs, output))
    if again or state(command, output, whole) != "whole" or leftovers(place):
        trouble = (
            trouble or f"WRONG: the next run: exit {again}, {said[-150:]!r}, {leftovers(place)}"
        )
    return trouble or (f"WRONG: left {left}" if left else "")


def short_files(command: Command, inputs: Path, place: Path, whole: dict[str, str]) -> list[str]:
    """No file may grow beyond a size, for sizes up to one that is enough: as a disk or a quota that
    fills up within a file.
    """
    largest = (
        max(path.stat().st_size for path in (place / command.output).rglob("*") if path.is_file())
        if not (place / command.output).is_file()
        else (place / command.output).stat().st_size
    )
    found = []
    for size in (0, 1, 4096, *(largest * k // 12 for k in range(1, 14))):
        fresh(place)
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
        try:
            code, _, text = run(command.line(inputs, place / command.output))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        found.append(
            _after(
                command, inputs, place, whole, code, text, ("nothing", "some scenes, each whole")
            )
        )
    return found


@contextlib.contextmanager
def mounted(place: Path, *options: str) -> Iterator[bool]:
    """Mounts something on the folder `place`; false where this user may not."""
    place.mkdir(parents=True, exist_ok=True)
    try:
        done = (
            subprocess.run(
                ["mount", *options, str(place)], capture_output=True, check=False
            ).returncode
            == 0
        )
    except FileNotFoundError:
        done = False
    try:
        yield done
    finally:
        if done:
            subprocess.run(["umount", str(place)], capture_output=True, check=False)


def small_disks(
    command: Command, inputs: Path, place: Path, whole: dict[str, str]
) -> list[str] | None:
    """Disks in memory, from one page on, until one is large enough: what was wrong.

    None where mounting is not allowed.
    """
    found, kilobytes = [], 4
    disk = place / "disk"
    while kilobytes < 1 << 14:
        fresh(place)
        with mounted(disk, "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs") as done:
            if not done:
                return None
            code, _, text = run(command.line(inputs, disk / command.output))
            seen, left = state(command, disk / command.output, whole), leftovers(disk)
        good = (
            seen == "whole"
            if code == 0
            else not one_line(code, text)
            and seen in ("nothing", "some scenes, each whole")
            and not left
        )
        found.append(
            ""
            if good
            else f"WRONG: {kilobytes} kB: exit {code}, {seen}, left {left}, {text[-200:]!r}"
        )
        if code == 0:
            return found
        kilobytes += max(4, kilobytes // 5)
    return [*found, "WRONG: no disk was large enough"]


def read_only(
    command: Command, inputs: Path, place: Path, whole: dict[str, str]
) -> list[str] | None:
    """A disk that was mounted for reading alone, with and without an earlier output on it.

    None where mounting is not allowed.
    """
    found = []
    for earlier in (False, True):
        fresh(place)
        disk = place / "disk"
        disk.mkdir()
        if earlier:
            run(command.line(inputs, disk / command.output))
        with mounted(disk, "--bind", str(disk)) as bound:
            locked = (
                bound
                and subprocess.run(
                    ["mount", "-o", "remount,bind,ro", str(disk)], capture_output=True, check=False
                ).returncode
                == 0
            )
            if not locked:
                return None
            code, _, text = run(command.line(inputs, disk / command.output))
        seen = state(command, disk / command.output, whole)
        found.append(
            one_line(code, text)
            or ("" if seen == ("whole" if earlier else "nothing") else f"WRONG: {seen}")
        )
    return found


def fresh(place: Path) -> None:
    """An empty folder."""
    if place.exists():
        subprocess.run(["rm", "-rf", "--one-file-system", str(place)], check=True)
    place.mkdir(parents=True)


def reference(command: Command, inputs: Path, place: Path) -> dict[str, str]:
    """What a whole output is."""
    fresh(place)
    code, _, text = run(command.line(inputs, place / command.output))
    if code:
        raise RuntimeError(text)
    return digests(place / command.output)


Faults = Callable[[Command, Path, Path, dict[str, str]], list[str] | None]
FAULTS: dict[str, Faults] = {
    "every step that writes fails once": lambda c, i, p, w: broken_steps(c, i, p, w, False),
    "the same over an earlier output": lambda c, i, p, w: broken_steps(c, i, p, w, True),
    "files that may not grow": short_files,
    "full disks of every size": small_disks,
    "read-only disk": read_only,
}
__all__ = ["COMMANDS", "FAULTS", "fresh", "reference"]
