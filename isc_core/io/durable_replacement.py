"""Flushing files to the disk, and replacing a folder by another one.

Method: two folders are exchanged atomically where the system supports it (`renameat2`, Linux).
Elsewhere the previous folder is moved aside first. A process killed between these two renames
leaves the old content as `.NAME.xxxxxxxx.old`, which the next process restores
(`temporary_siblings`).
"""

import contextlib
import ctypes
import errno
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .temporary_siblings import MAX_SIBLINGS, Gone, lock, remove, sibling

_FLUSH_THREADS = 8
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # linux/fs.h


def flush(content: Path) -> None:
    """Flush a file, or a folder with its content, to the disk.

    Parameters
    ----------
    content : Path

    Raises
    ------
    OSError
        If it cannot be flushed; a full disk may be reported only then.
    """
    folders = (
        [content, *(entry for entry in content.rglob("*") if entry.is_dir())]
        if content.is_dir()
        else []
    )
    files = [entry for entry in content.rglob("*") if entry.is_file()] if folders else [content]
    with ThreadPoolExecutor(_FLUSH_THREADS) as pool:  # file systems combine pending writes
        list(pool.map(_flush_file, files))
    for folder in folders:
        flush_names(folder)


def _flush_file(file: Path) -> None:
    descriptor = os.open(file, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def flush_names(folder: Path) -> None:
    """Flush the entries of a folder to the disk, where the system supports it.

    Parameters
    ----------
    folder : Path
    """
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def put_in_place(partial: Path, target: Path) -> None:
    """Rename a folder, and remove the previous one of that name.

    Parameters
    ----------
    partial, target : Path
        The old and the new name.

    Raises
    ------
    OSError
        If it cannot be renamed.
    """
    while True:
        try:
            os.replace(partial, target)  # works if it does not exist or is an empty folder
            return
        except OSError as error:
            if (
                error.errno not in (errno.ENOTEMPTY, errno.EEXIST) and not target.is_dir()
            ) or not partial.exists():
                raise
        with (
            contextlib.suppress(Gone),
            lock(target, wait=True),
        ):  # gone: another process has just replaced it
            if _exchanged(partial, target):
                remove(partial)
            else:
                _replace_in_two_steps(partial, target)
            return


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange the names of two folders atomically; False if this is not supported."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    done = rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) == 0
    if not done and ctypes.get_errno() == errno.ENOENT:
        raise Gone(errno.ENOENT, "another process has removed it")
    return done


def _replace_in_two_steps(partial: Path, target: Path) -> None:
    """Move the previous folder aside first; restore it if the second step fails."""
    old = next(
        name
        for number in range(MAX_SIBLINGS)
        if not (name := sibling(target, number, "old")).exists()
    )
    os.replace(target, old)
    try:
        os.replace(partial, target)
    finally:
        if target.exists():
            remove(old)
        else:
            os.replace(old, target)
