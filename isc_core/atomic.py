"""Writing a folder or a file completely or not at all.

The content is written beside its final place under a temporary name and renamed once it is complete, so that the final name never holds
half of a result. What stood there before is replaced only then, and a folder only if everything in it is of the kind that we write:
nothing of anybody else's is ever deleted.

Limits: a process killed by force leaves its temporary sibling, `.NAME.xxxxxxxx.partial`, which may be deleted by hand, or by
`remove_unfinished` in the program that killed it.
"""

import contextlib
import errno
import os
import re
import secrets
import shutil
from collections.abc import Iterator, Sequence, Set
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError

_LITTER = (".DS_Store", "Thumbs.db", "desktop.ini")  # what file managers leave in any folder they have shown

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
    """Gives an empty temporary folder to fill; renames it to `folder` when the block ends well, else removes it.

    `ours`: the files that a folder of this kind holds, as relative paths with `/`; the first is its mark, without which a folder is
    not ours. An existing `folder` is replaced if it is empty, or holds the mark and nothing but these files.
    Raises `InputError` if `folder` is something else, or cannot be written.
    """
    target = _resolved(folder)
    require_replaceable(target, ours)
    with _explained(target), _made_parents(target):
        partial = _sibling(target, "partial")
        partial.mkdir()
        try:
            yield partial
            require_replaceable(target, ours)
            _put_in_place(partial, target)
        finally:
            shutil.rmtree(partial, ignore_errors=True)


@contextmanager
def new_file(path: Path | str) -> Iterator[Path]:
    """Gives a temporary path to write to; renames it to `path` when the block ends well, else removes it.

    An existing file is replaced. Raises `InputError` if `path` is a folder or cannot be written.
    """
    target = _resolved(path)
    if target.is_dir():
        raise InputError(f"{path} is a folder: name a file")
    with _explained(target), _made_parents(target):
        partial = _sibling(target, "partial")
        try:
            yield partial
            os.replace(partial, target)
        finally:
            partial.unlink(missing_ok=True)


def require_writable(folder: Path | str, ours: Sequence[str]) -> None:
    """Tries now whether `new_folder` could begin, before hours of work are spent. Leaves no trace. Raises `InputError`."""
    target = _resolved(folder)
    require_replaceable(target, ours)
    with _explained(target), _made_parents(target, keep=False):
        probe = _sibling(target, "partial")
        probe.mkdir()
        probe.rmdir()


def require_writable_file(path: Path | str) -> None:
    """Tries now whether `new_file` could begin, before hours of work are spent. Leaves no trace. Raises `InputError`."""
    target = _resolved(path)
    if target.is_dir():
        raise InputError(f"{path} is a folder: name a file")
    with _explained(target), _made_parents(target, keep=False):
        probe = _sibling(target, "partial")
        probe.mkdir()
        probe.rmdir()


def unfinished(path: Path | str) -> frozenset[Path]:
    """The temporary siblings of `path` that there are now: of processes at work, or killed by force."""
    target = _resolved(path)
    names = re.compile(re.escape(f".{target.name}.") + r"[0-9a-f]{8}\.(partial|old)")
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        return frozenset(entry for entry in target.parent.iterdir() if names.fullmatch(entry.name))
    return frozenset()


def remove_unfinished(path: Path | str, spared: Set[Path] = frozenset()) -> None:
    """Tidies up after a process that was killed by force while it wrote `path`: removes its temporary siblings, but for those `spared`,
    and puts back what it had moved aside."""
    target = _resolved(path)
    for left in sorted(unfinished(target) - spared):
        if left.suffix == ".old" and not target.exists():
            os.replace(left, target)
        elif left.is_dir():
            shutil.rmtree(left, ignore_errors=True)
        else:
            left.unlink(missing_ok=True)


def require_replaceable(folder: Path, ours: Sequence[str]) -> None:
    """Raises `InputError` unless `folder` may be created or replaced (see `new_folder`)."""
    with _explained(folder):
        if not folder.exists():
            return
        if not folder.is_dir():
            raise InputError(f"{folder} is a file: name a folder")
        if folder == Path.cwd() or folder.is_mount():
            raise InputError(f"{folder} itself cannot be replaced: name a folder inside it")
        entries = sorted(entry for entry in folder.rglob("*") if entry.name not in _LITTER)
        found = [entry.relative_to(folder).as_posix() for entry in entries if entry.is_symlink() or not entry.is_dir()]
    if entries and ours[0] not in found:
        raise InputError(f"{folder} is not empty and not a result of this command: choose another folder")
    if foreign := [name for name in found if name not in ours]:
        raise InputError(f"{folder} also holds {foreign[0]}, which is not part of a result: move it away or choose another folder")


def _resolved(path: Path | str) -> Path:
    try:
        return Path(path).expanduser().resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, an unknown user, a zero byte
        raise InputError(f"{str(path)!r} is not a path that can be written: {error}") from error


def _sibling(target: Path, suffix: str) -> Path:
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.{suffix}")


def _put_in_place(partial: Path, target: Path) -> None:
    """Renames `partial` to `target`. What was there is moved aside first and comes back if the second step fails."""
    if not target.exists():
        os.replace(partial, target)
        return
    old = _sibling(target, "old")
    os.replace(target, old)
    try:
        os.replace(partial, target)
    finally:
        if target.exists():
            shutil.rmtree(old, ignore_errors=True)
        else:
            os.replace(old, target)


@contextmanager
def _made_parents(target: Path, *, keep: bool = True) -> Iterator[None]:
    """Creates the parent folders that lack; removes them again unless the block ends well and they are to be kept."""
    missing = [parent for parent in target.parents if not parent.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield
        missing = missing if not keep else []
    finally:
        for parent in missing:  # the innermost first; one that somebody else has filled meanwhile stays
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
