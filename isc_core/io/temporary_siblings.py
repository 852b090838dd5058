"""Temporary siblings: what a process writes beside its target, locked until it is complete.

A writing process holds a lock on its temporary sibling, `.NAME.xxxxxxxx.partial`. The next process
that writes the same name removes siblings without a lock, which belong to killed processes. The
lock is on the sibling itself, not on a separate lock file, so that it moves with the rename;
therefore `flock` is used and not the library `filelock`.

Limits: without such locks (Windows, some network disks) and for other machines, siblings of killed
processes remain. Entries to be removed are first renamed to `.NAME.xxxxxxxx.gone`.
"""

import contextlib
import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

MAX_SIBLINGS = 0x10000
_TEMPORARY = re.compile(r"\.(.+)\.[0-9a-f]{8}\.(partial|old|gone)", re.DOTALL)
# Bytes of a name, of the usual 255, with room for the suffix of a temporary sibling.
_MAX_NAME_BYTES = 230


def label_of(target: Path) -> str:
    """Return the target's part of the name of its siblings.

    Parameters
    ----------
    target : Path

    Returns
    -------
    str
        The target's name, or a digest of it if it is too long.
    """
    coded = os.fsencode(target.name)
    return target.name if len(coded) <= _MAX_NAME_BYTES else hashlib.sha256(coded).hexdigest()


def origin_of(entry: Path) -> str | None:
    """Return the label of the target of which an entry is a temporary sibling.

    Parameters
    ----------
    entry : Path

    Returns
    -------
    str or None
        None if it is not a temporary sibling.
    """
    found = _TEMPORARY.fullmatch(entry.name)
    return None if found is None else found[1]


def sibling(target: Path, number: int, suffix: str) -> Path:
    """Return the path of a temporary sibling.

    Parameters
    ----------
    target : Path
    number : int
        Below `MAX_SIBLINGS`.
    suffix : {"partial", "old", "gone"}

    Returns
    -------
    Path
        Its name depends on the machine, because locks of other machines may not be visible.
    """
    machine = hashlib.sha256(platform.node().encode()).hexdigest()[:4]
    return target.with_name(f".{label_of(target)}.{machine}{number:04x}.{suffix}")


@contextmanager
def temporary_sibling(target: Path, *, is_folder: bool) -> Iterator[Path]:
    """Create a temporary sibling, locked during the block; remove it afterwards if it is there.

    Parameters
    ----------
    target : Path
    is_folder : bool
        Whether it is a folder; else a file.

    Returns
    -------
    Path

    Raises
    ------
    OSError
        If it cannot be created.
    """
    with contextlib.ExitStack() as stack:
        for number in range(MAX_SIBLINGS):
            partial = sibling(target, number, "partial")
            for leftover in (sibling(target, number, "old"), partial):
                _sweep(leftover, target)
            try:
                partial.mkdir() if is_folder else partial.touch(exist_ok=False)
                stack.enter_context(lock(partial, wait=True))
            except (
                FileExistsError,
                Gone,
            ):  # another process uses that name, or removed this sibling as a leftover
                continue
            stack.callback(_remove_same, partial, partial.stat())
            yield partial
            return
    raise OSError(
        errno.EBUSY, "too many processes write there; wait for them, or choose another place"
    )


def _sweep(leftover: Path, target: Path) -> None:
    """Clean up if `leftover` belongs to a killed process that wrote `target`."""
    with (
        contextlib.suppress(OSError),
        lock(leftover, wait=False) as locked,
    ):  # it does not exist, or is in use
        if locked:
            tidy(leftover, target)


def tidy(leftover: Path, target: Path) -> None:
    """Remove a sibling of a killed process, or restore the content that it had moved aside.

    Parameters
    ----------
    leftover, target : Path

    Raises
    ------
    OSError
        If it cannot be renamed.
    """
    if leftover.suffix == ".old" and not target.exists():
        os.replace(leftover, target)
    else:
        # Renamed first: without locks its writer may still run, and rename the half-removed folder
        # to the final name.
        gone = target.with_name(f".{label_of(target)}.{secrets.token_hex(4)}.gone")
        os.replace(leftover, gone)
        remove(gone)


def remove(entry: Path) -> None:
    """Remove a file or a folder with its content, as far as the system permits.

    Parameters
    ----------
    entry : Path
    """
    if entry.is_dir():
        shutil.rmtree(entry, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            entry.unlink(missing_ok=True)


def _remove_same(entry: Path, made: os.stat_result) -> None:
    """Remove `entry` unless it was renamed: another process may use its name by now."""
    with contextlib.suppress(OSError):
        if os.path.samestat(made, entry.stat()):
            remove(entry)


class Gone(OSError):
    """The file or folder to lock no longer exists."""


@contextmanager
def lock(entry: Path, *, wait: bool) -> Iterator[bool]:
    """Lock a file or folder during the block, or until the process ends.

    Parameters
    ----------
    entry : Path
    wait : bool
        Whether to wait for another process that has the lock.

    Returns
    -------
    bool
        False without support for locks.

    Raises
    ------
    OSError
        If another process has the lock and `wait` is false.
    Gone
        If the entry no longer exists when locked.
    """
    if fcntl is None:
        yield False
        return
    try:
        descriptor = os.open(entry, os.O_RDONLY)
    except FileNotFoundError as error:
        raise Gone(errno.ENOENT, "it is gone") from error
    try:
        locked = _acquired(descriptor, wait)
        if not _is_named(descriptor, entry):
            raise Gone(errno.ENOENT, "it is gone")
        yield locked
    finally:
        os.close(descriptor)


def _is_named(descriptor: int, entry: Path) -> bool:
    """Whether an open file or folder still has that name, by a single lookup, since it may be
    renamed between two.
    """
    with contextlib.suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(descriptor), entry.stat())
    return False


def _acquired(descriptor: int, wait: bool) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        raise
    except OSError:  # the file system does not support locks
        return False
    return True
