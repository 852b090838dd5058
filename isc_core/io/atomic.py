"""Atomic writes: a folder or a file appears completely or not at all.

The content is written next to its final path under a temporary name, flushed to disk, and renamed
once it is complete, so that the final path never has an incomplete result (`temporary_siblings`,
`durable_replacement`). Previous content is replaced only then, atomically where the system supports
it (Linux), and a folder only if it contains only files that this program writes: foreign files are
never deleted.

Limits: without locks (Windows, some network disks) and for other machines, temporary siblings of
killed processes remain; delete them by hand, or by `remove_unfinished` where no other process is
writing.
"""

import contextlib
import errno
import os
from collections.abc import Iterable, Iterator, Sequence, Set
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError
from .durable_replacement import flush, flush_names, put_in_place
from .temporary_siblings import label_of, lock, origin_of, temporary_sibling, tidy

_FILE_MANAGER_FILES = (".DS_Store", "Thumbs.db", "desktop.ini")

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
        explained(target),
        _made_parents(target),
        temporary_sibling(target, is_folder=True) as partial,
    ):
        yield partial
        require_replaceable(target, ours)
        flush(partial)
        put_in_place(partial, target)
        flush_names(target.parent)


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
        explained(target),
        _made_parents(target),
        temporary_sibling(target, is_folder=False) as partial,
    ):
        yield partial
        flush(partial)
        os.replace(partial, target)
        flush_names(target.parent)


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
            entry for entry in target.parent.iterdir() if origin_of(entry) == label_of(target)
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
        with contextlib.suppress(OSError), lock(leftover, wait=False):
            tidy(leftover, target)


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
            origin for entry in folder.iterdir() if (origin := origin_of(entry)) is not None
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
    with explained(folder):
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
            if entry.name not in _FILE_MANAGER_FILES and origin_of(entry) not in reserved
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
    with explained(target):
        if target.is_dir():
            raise InputError(f"{target} is a folder: choose a file")
        if target.exists() and not target.is_file():
            raise InputError(f"{target} is not a regular file: choose another")


def _try_writing(target: Path) -> None:
    """Create and remove a temporary sibling in the innermost existing parent, since creating and
    removing parents could interfere with another process.
    """
    with explained(target):
        parent = next(folder for folder in target.parents if folder.exists())
        with temporary_sibling(parent / target.name, is_folder=True):
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
def explained(target: Path) -> Iterator[None]:
    """Turn system errors of the block into one-line messages.

    Parameters
    ----------
    target : Path
        What is written.

    Returns
    -------
    context manager

    Raises
    ------
    InputError
        For an `OSError`.
    """
    try:
        yield
    except OSError as error:
        reason = _REASONS.get(error.errno or 0, error.strerror or str(error))
        raise InputError(f"cannot write {target}: {reason}") from error
