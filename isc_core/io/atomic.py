"""Writing a folder or a file completely or not at all.

The content is written beside its final place under a temporary name, flushed to disk, and renamed
once it is complete, so that the final name never holds half of a result. What stood there before is
replaced only then, in one step where the system supports it (Linux), and a folder only if
everything in it is of the kind that this program writes: foreign files are never deleted.

A process at work holds a lock on its temporary sibling, `.NAME.xxxxxxxx.partial`. The next process
that writes the same name removes siblings without a lock, which belong to killed processes. The
lock is on the sibling itself, not on a lock file beside it, so that it moves with the rename: that
is why `flock` is used here and not the library `filelock`.

Limits: without such locks (Windows, some network disks) and for other machines, siblings of killed
processes stay; delete them by hand, or by `remove_unfinished` where nobody else is at work. What is
removed is renamed to `.NAME.xxxxxxxx.gone` first. Without the exchange in one step, a process
killed between two renames leaves the old content as `.NAME.xxxxxxxx.old`, which the next process
puts back.
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
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_LITTER = (
    ".DS_Store",
    "Thumbs.db",
    "desktop.ini",
)  # what file managers leave in any folder they have shown
_TEMPORARY = re.compile(r"\.(.+)\.[0-9a-f]{8}\.(partial|old|gone)", re.DOTALL)
_MOST_SIBLINGS = 0x10000
_LONGEST = (
    230  # bytes of a name that leave room, of the usual 255, for what a temporary sibling adds
)
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # linux/fs.h

_REASONS = {
    errno.ENOSPC: "no space is left on the disk; free some or choose another place",
    errno.EDQUOT: "the disk quota is used up; free some space or choose another place",
    errno.EFBIG: "the file grows beyond what is allowed here; choose another place",
    errno.EACCES: "writing is not allowed there; choose another place",
    errno.EPERM: "writing is not allowed there; choose another place",
    errno.EROFS: "the disk is read-only; choose another place",
    errno.ENOTDIR: "a part of the path is a file, not a folder; choose another place",
    errno.EEXIST: "a part of the path is a file, not a folder; choose another place",
    errno.ENOENT: "nothing can be created there; choose another place",
    errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
}


@contextmanager
def new_folder(folder: Path | str, ours: Sequence[str]) -> Iterator[Path]:
    """Provide an empty temporary folder and rename it to `folder` when the block succeeds.

    An existing `folder` is replaced if it is empty, or holds the marker file and nothing but
    `ours`.

    Parameters
    ----------
    folder : Path or str
    ours : sequence of str
        Files that a folder of this kind holds, as relative paths with `/`. The first one is the
        marker, without which a folder counts as foreign.

    Raises
    ------
    InputError
        If `folder` is something else, or cannot be written.
    """
    target = _resolved(folder)
    require_replaceable(target, ours)
    with _explained(target), _made_parents(target), _begun(target, is_folder=True) as partial:
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

    Raises
    ------
    InputError
        If `path` is a folder or a device, or cannot be written.
    """
    target = _resolved(path)
    _require_replaceable_file(target)
    with _explained(target), _made_parents(target), _begun(target, is_folder=False) as partial:
        yield partial
        _flush(partial)
        os.replace(partial, target)
        _flush_names(target.parent)


def require_writable(
    folder: Path | str, ours: Sequence[str], inputs: Iterable[Path | None] = ()
) -> None:
    """Check that `new_folder` can begin, before hours of work are spent; leaves no trace.

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
    for given in inputs:
        if (
            given is not None
            and target in (resolved := _resolved(given)).parents
            and resolved.exists()
        ):
            raise InputError(
                f"{given} lies in {folder}, which would be replaced: choose another folder"
            )
    _try_beside(target)


def require_writable_file(path: Path | str) -> None:
    """Check that `new_file` can begin, before hours of work are spent; leaves no trace.

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
    _try_beside(target)


def unfinished(path: Path | str) -> frozenset[Path]:
    """Return the temporary siblings of `path`, of processes at work or killed.

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

    Removes their temporary siblings and restores what they had moved aside.

    Parameters
    ----------
    path : Path or str
    spared : set of Path
        Siblings to keep; so are all that a process holds a lock on.
    """
    target = _resolved(path)
    for left in sorted(unfinished(target) - spared):
        with contextlib.suppress(OSError), _held(left, wait=False):
            _tidy(left, target)


def remove_unfinished_in(folder: Path) -> None:
    """Apply `remove_unfinished` to everything in `folder`, which need not exist."""
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        for name in {
            origin for entry in folder.iterdir() if (origin := _origin(entry)) is not None
        }:
            remove_unfinished(folder / name)


def require_replaceable(folder: Path, ours: Sequence[str]) -> None:
    """Raise `InputError` unless `folder` may be created or replaced (see `new_folder`)."""
    with _explained(folder):
        if not folder.exists():
            return
        if not folder.is_dir():
            raise InputError(f"{folder} is a file: name a folder")
        if folder == Path.cwd() or folder.is_mount():
            raise InputError(f"{folder} itself cannot be replaced: name a folder inside it")
        known = {name.rpartition("/")[2] for name in ours}
        entries = sorted(
            entry
            for entry in folder.rglob("*")
            if entry.name not in _LITTER and _origin(entry) not in known
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
            raise InputError(f"{target} is a folder: name a file")
        if target.exists() and not target.is_file():
            raise InputError(f"{target} is not a regular file: name another")


def _try_beside(target: Path) -> None:
    """Where parents lack, in the innermost that is there: to make and remove them could take them
    away from another process.
    """
    with _explained(target):
        place = next(parent for parent in target.parents if parent.exists())
        with _begun(place / target.name, is_folder=True):
            pass


def _resolved(path: Path | str) -> Path:
    try:
        return Path(path).expanduser().resolve()
    except (
        OSError,
        RuntimeError,
        ValueError,
    ) as error:  # a loop of links, an unknown user, a zero byte
        raise InputError(f"{str(path)!r} is not a path that can be written: {error}") from error


# --- temporary siblings ---------------------------------------------------------------------------


def _label(target: Path) -> str:
    """The target's part of a sibling's name; a digest of names that are too long."""
    coded = os.fsencode(target.name)
    return target.name if len(coded) <= _LONGEST else hashlib.sha256(coded).hexdigest()


def _origin(entry: Path) -> str | None:
    """The label of the name that `entry` is a temporary sibling of, if it is one."""
    found = _TEMPORARY.fullmatch(entry.name)
    return None if found is None else found[1]


def _sibling(target: Path, number: int, suffix: str) -> Path:
    """The temporary sibling of that number that is this machine's: another one's locks may not be
    seen from here.
    """
    machine = hashlib.sha256(platform.node().encode()).hexdigest()[:4]
    return target.with_name(f".{_label(target)}.{machine}{number:04x}.{suffix}")


@contextmanager
def _begun(target: Path, *, is_folder: bool) -> Iterator[Path]:
    """A new temporary sibling of `target`, held while the block lasts and removed at its end, if it
    is still there.
    """
    with contextlib.ExitStack() as stack:
        for number in range(_MOST_SIBLINGS):
            partial = _sibling(target, number, "partial")
            for left in (_sibling(target, number, "old"), partial):
                _sweep(left, target)
            try:
                partial.mkdir() if is_folder else partial.touch(exist_ok=False)
                stack.enter_context(_held(partial, wait=True))
            except (
                FileExistsError,
                _Gone,
            ):  # another process is at work under that name, or took this one for left behind
                continue
            stack.callback(_remove_same, partial, partial.stat())
            yield partial
            return
    raise OSError(
        errno.EBUSY, "too many others write there; wait for them, or choose another place"
    )


def _sweep(left: Path, target: Path) -> None:
    """Tidies up if `left` is of a process that was killed by force while it wrote `target`."""
    with (
        contextlib.suppress(OSError),
        _held(left, wait=False) as held,
    ):  # it is not there, or somebody works on it
        if held:
            _tidy(left, target)


def _tidy(left: Path, target: Path) -> None:
    if left.suffix == ".old" and not target.exists():
        os.replace(left, target)
    else:
        # Renamed first: where there are no locks its writer may live, and give what is half removed
        # the final name.
        gone = target.with_name(f".{_label(target)}.{secrets.token_hex(4)}.gone")
        os.replace(left, gone)
        _remove(gone)


def _remove(entry: Path) -> None:
    if entry.is_dir():
        shutil.rmtree(entry, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            entry.unlink(missing_ok=True)


def _remove_same(entry: Path, made: os.stat_result) -> None:
    """Removes `entry` unless it was renamed: its name may be another process's by now."""
    with contextlib.suppress(OSError):
        if os.path.samestat(made, entry.stat()):
            _remove(entry)


class _Gone(OSError):
    """What was to be held is not there any more."""


@contextmanager
def _held(entry: Path, *, wait: bool) -> Iterator[bool]:
    """Holds a lock on a file or folder while the block lasts, which ends with the process in any
    case; false where there are no locks.

    Raises `OSError` if another process has it and it is not to be waited for, and if it is gone
    once it is held.
    """
    if fcntl is None:
        yield False
        return
    try:
        descriptor = os.open(entry, os.O_RDONLY)
    except FileNotFoundError as error:
        raise _Gone(errno.ENOENT, "it is gone") from error
    try:
        held = _locked(descriptor, wait)
        if not _is_named(descriptor, entry):
            raise _Gone(errno.ENOENT, "it is gone")
        yield held
    finally:
        os.close(descriptor)


def _is_named(descriptor: int, entry: Path) -> bool:
    """Whether an open file or folder still has that name: looked up once, for between two looks it
    may be renamed.
    """
    with contextlib.suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(descriptor), entry.stat())
    return False


def _locked(descriptor: int, wait: bool) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        raise
    except OSError:  # this disk knows no locks
        return False
    return True


# --- to the disk, and to the final name -----------------------------------------------------------


def _flush(content: Path) -> None:
    """Brings a file, or a folder with all that is in it, to the disk, which may find only now that
    it is full.
    """
    folders = (
        [content, *(entry for entry in content.rglob("*") if entry.is_dir())]
        if content.is_dir()
        else []
    )
    for file in (
        [content] if not folders else [entry for entry in content.rglob("*") if entry.is_file()]
    ):
        descriptor = os.open(file, os.O_RDWR)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    for folder in folders:
        _flush_names(folder)


def _flush_names(folder: Path) -> None:
    """Brings a folder's own entries to the disk, where the system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _put_in_place(partial: Path, target: Path) -> None:
    """Renames the folder `partial` to `target`, and removes what was there."""
    while True:
        try:
            os.replace(partial, target)  # onto nothing, or an empty folder
            return
        except OSError as error:
            if (
                error.errno not in (errno.ENOTEMPTY, errno.EEXIST) and not target.is_dir()
            ) or not partial.exists():
                raise
        with (
            contextlib.suppress(_Gone),
            _held(target, wait=True),
        ):  # gone: another process has just replaced it
            if _exchanged(partial, target):
                _remove(partial)
            else:
                _replace_in_two_steps(partial, target)
            return


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange the names of two folders in one step; False if this is not supported."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    done = rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) == 0
    if not done and ctypes.get_errno() == errno.ENOENT:
        raise _Gone(errno.ENOENT, "another process has removed it")
    return done


def _replace_in_two_steps(partial: Path, target: Path) -> None:
    """What was there is moved aside first and comes back if the second step fails."""
    old = next(
        name
        for number in range(_MOST_SIBLINGS)
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
    """Creates the parent folders that lack; removes them again unless the block ends well."""
    missing = [parent for parent in target.parents if not parent.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield
        missing = []
    finally:
        for (
            parent
        ) in missing:  # the innermost first; one that somebody else has filled meanwhile stays
            with contextlib.suppress(OSError):
                parent.rmdir()


@contextmanager
def _explained(target: Path) -> Iterator[None]:
    """Turns the system's error into one line for people."""
    try:
        yield
    except OSError as error:
        reason = _REASONS.get(error.errno or 0, error.strerror or str(error))
        raise InputError(f"cannot write {target}: {reason}") from error
