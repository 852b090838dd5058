"""A cache of results of earlier runs, keyed by the content that they depend on.

A result is stored in a folder whose name is a SHA-256 of everything that it depends on: the content
of photo and mask, the settings, and the files of `isc_core`. What is built from it in Blender is
not part of the key, nor are names and paths of files, as Blender packs them.

The worker writes a result under its final name complete or not at all. One that cannot be read is
removed and recomputed. If the folder exceeds its limit, the least recently used results are
removed. Only entries with the name of a key are; the user may have chosen a folder with other
files.

The worker stores results of stages that do not depend on model and separator, and the fits of the
refinement, in the same folder, in files of its own (`isc_core.io.stage_cache`). They count toward
the limit, and are removed like results.

Citation: FIPS 180-4, Secure Hash Standard, 2015.

Limits: the hash of `isc_core` is of names, sizes and dates of its files, not of their content. A
result that is larger than the limit stays until the next one is added.
"""

import contextlib
import hashlib
import os
import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from isc_core.errors import InputError
from isc_core.io.source_stamp import source_stamp

from .result_arrays import ARRAYS, ResultArrays, read_result

# Results, files of stages, and what remains of unfinished ones.
_OURS = re.compile(r"\.?[0-9a-f]{64}(\..+)?")


@dataclass(frozen=True)
class ResultCache:
    """Folder of results.

    Attributes
    ----------
    folder : Path
        Folder with one folder per result, and files of stages; created when it is first written
        to.
    limit : int
        Size in bytes above which results are removed.
    """

    folder: Path
    limit: int

    def place(self, key: str) -> Path:
        """Return the folder of a key's result, which need not exist.

        Parameters
        ----------
        key : str
            As `content_key` returns it.

        Returns
        -------
        Path
            The result folder.
        """
        return self.folder / key

    def read(self, key: str) -> ResultArrays | None:
        """Read a result, and mark it as used.

        Parameters
        ----------
        key : str
            As `content_key` returns it.

        Returns
        -------
        ResultArrays or None
            None if there is none; a damaged one is removed.
        """
        place = self.place(key)
        if not (place / ARRAYS).is_file():
            return None
        try:
            result = read_result(place)
        except InputError:
            shutil.rmtree(place, ignore_errors=True)
            return None
        with contextlib.suppress(OSError):  # a read-only cache can still be used
            os.utime(place)
        return result

    def store(self, key: str, made: Path) -> None:
        """Move a folder into the cache, completely or not at all.

        If another Blender has stored the same result in the meantime, that one is kept.

        Parameters
        ----------
        key : str
            As `content_key` returns it.
        made : Path
            A folder.

        Raises
        ------
        InputError
            If it cannot be moved.
        """
        place = self.place(key)
        partial = place.with_name(f"{key}.partial")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(partial, ignore_errors=True)
            shutil.move(made, partial)
            try:
                partial.rename(place)
            except OSError:
                if not place.is_dir():
                    raise
                shutil.rmtree(partial, ignore_errors=True)
        except OSError as error:
            raise InputError(f"cannot write {place}: {error.strerror or error}") from error

    def trim(self, keep: str) -> None:
        """Remove the least recently used entries until the rest fits.

        Parameters
        ----------
        keep : str
            Key of a result that stays.
        """
        with contextlib.suppress(OSError):  # another Blender may remove the same ones
            ours = [entry for entry in self.folder.iterdir() if _OURS.fullmatch(entry.name)]
            entries = sorted(ours, key=lambda entry: -entry.stat().st_mtime)
            room = self.limit - _size(self.place(keep))
            for entry in entries:
                if entry.name == keep:
                    continue
                room -= _size(entry)
                if room < 0:
                    _remove(entry)


def content_key(files: Sequence[Path | None], settings: Iterable[object], core: Path) -> str:
    """Return the cache key of everything that a result depends on.

    Parameters
    ----------
    files : sequence of Path or None
        Photo and mask.
    settings : iterable of object
        Settings, in a fixed order.
    core : Path
        Folder of the package `isc_core` that makes the result.

    Returns
    -------
    str
        Hexadecimal digits.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    digest = hashlib.sha256(repr(tuple(settings)).encode())
    for file in files:
        digest.update(b"\0none" if file is None else _file_digest(file))
    digest.update(source_stamp(core))
    return digest.hexdigest()


def _file_digest(path: Path) -> bytes:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").digest()


def _size(entry: Path) -> int:
    files = entry.rglob("*") if entry.is_dir() else (entry,)
    return sum(path.stat().st_size for path in files if path.is_file())


def _remove(entry: Path) -> None:
    if entry.is_dir():
        shutil.rmtree(entry, ignore_errors=True)
    else:
        entry.unlink(missing_ok=True)
