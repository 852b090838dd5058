"""Atomic writes: a folder or a file appears completely or not at all.

The content is written next to its final path under a temporary name, flushed to disk, and renamed
once it is complete, so that the final path never has an incomplete result. Previous content is
replaced only then, atomically where the system supports it (Linux), and a folder only if it
contains only files that this program writes: foreign files are never deleted.

A writing process holds a lock on its temporary sibling, `.NAME.xxxxxxxx.partial`. The next process
that writes the same name removes siblings without a lock, which belong to killed processes. The
lock is on the sibling itself, not on a separate lock file, so that it moves with the rename;
therefore `flock` is used and not the library `filelock`.

Limits: without such locks (Windows, some network disks) and for other machines, siblings of killed
processes remain; delete them by hand, or by `remove_unfinished` where no other process is writing.
Entries to be removed are first renamed to `.NAME.xxxxxxxx.gone`. Without atomic exchange, a process
killed between two renames leaves the old content as `.NAME.xxxxxxxx.old`, which the next process
restores.
"""

import contextlib
import ctypes
import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
from collections.abc import Iterable, Iterator, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_FILE_MANAGER_FILES = (
    ".DS_Store",
    "Thumbs.db",
    "desktop.ini",
)  # created by file managers
_TEMPORARY = re.compile(r"\.(.+)\.[0-9a-f]{8}\.(partial|old|gone)", re.DOTALL)
_MAX_SIBLINGS = 0x10000
_MAX_NAME_BYTES = (
    230  # bytes of a name, of the usual 255, with room for the suffix of a temporary sibling
)
_FLUSH_THREADS = 8
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # linux/fs.h

_REASONS = {
    errno.ENOSPC: "no space is left on the disk; free some space or choose another place",
    errno.EDQUOT: "the disk quota is used up; free some space or choose another place",
    errno.EFBIG: "the file exceeds the allowed size; choose another place",
    errno.EACCES: "permission denied; choose another place",
    errno.EPERM: "permission denied; choose another place",
    errno.EROFS: "the disk is read-only; choose another place",
    errno.ENOTDIR: "a part of the path is a file, not a folder; choose another place",
    errno.EEXIST: "a part of the path is a file, not a folder; choose another place",
    errno.ENOENT: "the path does not exist; choose another place",
    errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
}


@contextmanager
def new_folder(folder: Path | str, ours: Sequence[str]) -> Iterator[Path]:
    """Provide an empty temporary folder and rename it to `folder` when the block succeeds.

    An existing `folder` is replaced if it is empty, or contains the marker file and only files of
    `ours`.

    Parameters
    ----------
    folder : Path or str
    ours : sequence of str
        Files that a folder of this kind may contain, as relative paths with `/`. The first one is
        the marker, without which a folder is foreign.

    Returns
    -------
    Path
        The temporary folder, a sibling of `folder`.

    Raises
    ------
    InputError
        If `folder` is something else, or cannot be written.
    """
    target = _resolved(folder)
    require_replaceable(target, ours)
    with (
        _explained(target),
        _made_parents(target),
        _temporary_sibling(target, is_folder=True) as partial,
    ):
        yield partial
        require_replaceable(target, ours)
        _flush(partial)
        _put_in_place(partial, target)
        _flush_names(target.parent)


@contextmanager
def new_file(path: Path | str) -> Iterator[Path]:
    """Provide an empty temporary file and rename it to `path` when the block succeeds.

    An existing file is replaced.

    Parameters
    ----------
    path : Path or str

    Returns
    -------
    Path
        The temporary file, a sibling of `path`.

    Raises
    ------
    InputError
        If `path` is a folder or a device, or cannot be written.
    """
    target = _resolved(path)
    _require_replaceable_file(target)
    with (
        _explained(target),
        _made_parents(target),
        _temporary_sibling(target, is_folder=False) as partial,
    ):
        yield partial
        _flush(partial)
        os.replace(partial, target)
        _flush_names(target.parent)


def require_writable(
    folder: Path | str, ours: Sequence[str], inputs: Iterable[Path | None] = ()
) -> None:
    """Check that `new_folder` can begin, before long work begins; leaves no files.

    Parameters
    ----------
    folder : Path or str
    ours : sequence of str
        See `new_folder`.
    inputs : iterable of Path
        Inputs of the work, which must not lie in the folder.

    Raises
    ------
    InputError
        If the folder cannot be written, or would replace an input.
    """
    target = _resolved(folder)
    require_replaceable(target, ours)
    for input_path in inputs:
        if (
            input_path is not None
            and target in (resolved := _resolved(input_path, "read")).parents
            and resolved.exists()
        ):
            raise InputError(
                f"{input_path} lies in {folder}, which would be replaced: choose another folder"
            )
    _try_writing(target)


def require_writable_file(path: Path | str) -> None:
    """Check that `new_file` can begin, before long work begins; leaves no files.

    Parameters
    ----------
    path : Path or str

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    target = _resolved(path)
    _require_replaceable_file(target)
    _try_writing(target)


def unfinished(path: Path | str) -> frozenset[Path]:
    """Return the temporary siblings of `path`, of running or killed processes.

    Parameters
    ----------
    path : Path or str

    Returns
    -------
    frozenset of Path
    """
    target = _resolved(path)
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        return frozenset(
            entry for entry in target.parent.iterdir() if _origin(entry) == _label(target)
        )
    return frozenset()


def remove_unfinished(path: Path | str, spared: Set[Path] = frozenset()) -> None:
    """Clean up after processes that were killed while they wrote `path`.

    Removes their temporary siblings and restores content that they had moved aside.

    Parameters
    ----------
    path : Path or str
    spared : set of Path
        Siblings to keep, in addition to all locked ones.
    """
    target = _resolved(path)
    for leftover in sorted(unfinished(target) - spared):
        with contextlib.suppress(OSError), _lock(leftover, wait=False):
            _tidy(leftover, target)


def remove_unfinished_in(folder: Path, spared: Set[Path] = frozenset()) -> None:
    """Apply `remove_unfinished` to everything in a folder.

    Parameters
    ----------
    folder : Path
        Need not exist.
    spared : set of Path
        As for `remove_unfinished`.
    """
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        for name in {
            origin for entry in folder.iterdir() if (origin := _origin(entry)) is not None
        }:
            remove_unfinished(folder / name, spared)


def require_replaceable(folder: Path, ours: Sequence[str]) -> None:
    """Require that a folder may be created or replaced, see `new_folder`.

    Parameters
    ----------
    folder : Path
    ours : sequence of str
        Files that a folder of this kind may contain, as relative paths with `/`; the marker first.

    Raises
    ------
    InputError
        If `folder` is a file, the working folder or a mount point, or contains foreign files.
    """
    with _explained(folder):
        if not folder.exists():
            return
        if not folder.is_dir():
            raise InputError(f"{folder} is a file: choose a folder")
        if folder == Path.cwd() or folder.is_mount():
            raise InputError(f"{folder} itself cannot be replaced: choose a folder inside it")
        reserved = {name.rpartition("/")[2] for name in ours}
        entries = sorted(
            entry
            for entry in folder.rglob("*")
            if entry.name not in _FILE_MANAGER_FILES and _origin(entry) not in reserved
        )
        found = [
            entry.relative_to(folder).as_posix()
            for entry in entries
            if entry.is_symlink() or not entry.is_dir()
        ]
    if entries and ours[0] not in found:
        raise InputError(
            f"{folder} is not empty and not a result of this command: choose another folder"
        )
    if foreign := [name for name in found if name not in ours]:
        raise InputError(
            f"{folder} also holds {foreign[0]}, which is not part of a result: move it away or "
            "choose another folder"
        )


def _require_replaceable_file(target: Path) -> None:
    with _explained(target):
        if target.is_dir():
            raise InputError(f"{target} is a folder: choose a file")
        if target.exists() and not target.is_file():
            raise InputError(f"{target} is not a regular file: choose another")


def _try_writing(target: Path) -> None:
    """Create and remove a temporary sibling in the innermost existing parent, since creating and
    removing parents could interfere with another process.
    """
    with _explained(target):
        parent = next(folder for folder in target.parents if folder.exists())
        with _temporary_sibling(parent / target.name, is_folder=True):
            pass


def _resolved(path: Path | str, use: str = "written") -> Path:
    try:
        return Path(path).expanduser().resolve()
    except (
        OSError,
        RuntimeError,
        ValueError,
    ) as error:  # a loop of links, an unknown user, a null byte
        raise InputError(f"{str(path)!r} is not a path that can be {use}: {error}") from error


# --- temporary siblings ---------------------------------------------------------------------------


def _label(target: Path) -> str:
    """The target's part of a sibling's name; a digest for names that are too long."""
    coded = os.fsencode(target.name)
    return target.name if len(coded) <= _MAX_NAME_BYTES else hashlib.sha256(coded).hexdigest()


def _origin(entry: Path) -> str | None:
    """The label of the target of which `entry` is a temporary sibling, if it is one."""
    found = _TEMPORARY.fullmatch(entry.name)
    return None if found is None else found[1]


def _sibling(target: Path, number: int, suffix: str) -> Path:
    """The temporary sibling with a number. The name depends on the machine, because locks of other
    machines may not be visible.
    """
    machine = hashlib.sha256(platform.node().encode()).hexdigest()[:4]
    return target.with_name(f".{_label(target)}.{machine}{number:04x}.{suffix}")


@contextmanager
def _temporary_sibling(target: Path, *, is_folder: bool) -> Iterator[Path]:
    """A new temporary sibling of `target`, locked during the block and removed at its end if it
    still exists.
    """
    with contextlib.ExitStack() as stack:
        for number in range(_MAX_SIBLINGS):
            partial = _sibling(target, number, "partial")
            for leftover in (_sibling(target, number, "old"), partial):
                _sweep(leftover, target)
            try:
                partial.mkdir() if is_folder else partial.touch(exist_ok=False)
                stack.enter_context(_lock(partial, wait=True))
            except (
                FileExistsError,
                _Gone,
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
        _lock(leftover, wait=False) as locked,
    ):  # it does not exist, or is in use
        if locked:
            _tidy(leftover, target)


def _tidy(leftover: Path, target: Path) -> None:
    if leftover.suffix == ".old" and not target.exists():
        os.replace(leftover, target)
    else:
        # Renamed first: without locks its writer may still run, and rename the half-removed folder
        # to the final name.
        gone = target.with_name(f".{_label(target)}.{secrets.token_hex(4)}.gone")
        os.replace(leftover, gone)
        _remove(gone)


def _remove(entry: Path) -> None:
    if entry.is_dir():
        shutil.rmtree(entry, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            entry.unlink(missing_ok=True)


def _remove_same(entry: Path, made: os.stat_result) -> None:
    """Remove `entry` unless it was renamed: another process may use its name by now."""
    with contextlib.suppress(OSError):
        if os.path.samestat(made, entry.stat()):
            _remove(entry)


class _Gone(OSError):
    """The file or folder to lock no longer exists."""


@contextmanager
def _lock(entry: Path, *, wait: bool) -> Iterator[bool]:
    """Lock a file or folder during the block, or until the process ends. Yields False without
    support for locks.

    Raises `OSError` if another process has the lock and `wait` is false, or if the entry no longer
    exists when locked.
    """
    if fcntl is None:
        yield False
        return
    try:
        descriptor = os.open(entry, os.O_RDONLY)
    except FileNotFoundError as error:
        raise _Gone(errno.ENOENT, "it is gone") from error
    try:
        locked = _acquired(descriptor, wait)
        if not _is_named(descriptor, entry):
            raise _Gone(errno.ENOENT, "it is gone")
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


# --- flushing and renaming ------------------------------------------------------------------------


def _flush(content: Path) -> None:
    """Flush a file, or a folder with its content, to the disk; a full disk may be reported only
    then.
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
        _flush_names(folder)


def _flush_file(file: Path) -> None:
    descriptor = os.open(file, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _flush_names(folder: Path) -> None:
    """Flush the entries of a folder to the disk, where the system supports it."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _put_in_place(partial: Path, target: Path) -> None:
    """Rename the folder `partial` to `target`, and remove the previous one."""
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
            contextlib.suppress(_Gone),
            _lock(target, wait=True),
        ):  # gone: another process has just replaced it
            if _exchanged(partial, target):
                _remove(partial)
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
        raise _Gone(errno.ENOENT, "another process has removed it")
    return done


def _replace_in_two_steps(partial: Path, target: Path) -> None:
    """Move the previous folder aside first; restore it if the second step fails."""
    old = next(
        name
        for number in range(_MAX_SIBLINGS)
        if not (name := _sibling(target, number, "old")).exists()
    )
    os.replace(target, old)
    try:
        os.replace(partial, target)
    finally:
        if target.exists():
            _remove(old)
        else:
            os.replace(old, target)


@contextmanager
def _made_parents(target: Path) -> Iterator[None]:
    """Create missing parent folders; remove them again unless the block succeeds."""
    missing = [parent for parent in target.parents if not parent.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield
        missing = []
    finally:
        for parent in missing:  # innermost first; folders that another process has filled are kept
            with contextlib.suppress(OSError):
                parent.rmdir()


@contextmanager
def _explained(target: Path) -> Iterator[None]:
    """Turn system errors into one-line messages."""
    try:
        yield
    except OSError as error:
        reason = _REASONS.get(error.errno or 0, error.strerror or str(error))
        raise InputError(f"cannot write {target}: {reason}") from error
