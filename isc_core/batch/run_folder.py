"""The output folder of a batch: its lock, its files, and cleanup after killed runs.

    OUT/NAME/                one result each, complete or absent
    OUT/NAME/1, 2, ...       one result for each object of a photo
    OUT/thumbnails/NAME.jpg, thumbnails/each/NAME/1.jpg, ...
    OUT/failures.jsonl       grows during a run
    OUT/summary.html, summary-pages/, summary.csv, summary.jsonl    written at the end
    OUT/.isc-batch/          lock, owner, run identifier, journal, attempts, fetched files

The lock (`filelock`) is held by the kernel and is always released when the process ends, so that
there are no stale locks. The file `owner` names the process that holds it.
"""

import contextlib
import os
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError
from ..io.atomic import explained, remove_unfinished_in
from ..result_files.object_folders import holds_result
from .names import OWN_FILES

THUMBNAILS, _EACH = "thumbnails", "each"


def thumbnail_place(name: str) -> str:
    """Return the path of a result's thumbnail, from the output folder.

    Parameters
    ----------
    name : str
        Of the result; that of an object has a "/".

    Returns
    -------
    str
        With "/". Objects have a separate folder, because a photo's name may end with ".jpg", too.
    """
    return "/".join((THUMBNAILS, *((_EACH,) if "/" in name else ()), f"{name}.jpg"))


class RunFolder:
    """The paths of an output folder, and operations on it as a whole."""

    def __init__(self, output: Path) -> None:
        self.output = output
        self.private = private = output / ".isc-batch"
        self.attempts, self.fetched = private / "attempts", private / "fetched"
        self.lock, self.owner = private / "lock", private / "owner"
        self.run, self.journal = private / "run", private / "journal.jsonl"
        self.failures = output / "failures.jsonl"
        self.thumbnails, self.pages = output / THUMBNAILS, output / "summary-pages"

    def thumbnail(self, name: str) -> Path:
        """Return the path of a result's thumbnail.

        Parameters
        ----------
        name : str
            Name of the result.

        Returns
        -------
        Path
        """
        return self.output / thumbnail_place(name)

    def attempt(self, name: str) -> Path:
        """Return the file that exists while a worker processes a result, see `attempts`.

        Parameters
        ----------
        name : str
            Name of the result.

        Returns
        -------
        Path
        """
        return self.attempts / name.replace("/", " ")  # names have no spaces

    def wrote(self, folder: Path) -> bool:
        """Return whether a folder is one of those that runs write into the output folder.

        Parameters
        ----------
        folder : Path

        Returns
        -------
        bool
            False for the output folder itself, and for folders of photos in it.
        """
        real, output = folder.resolve(), self.output.resolve()
        if not real.is_relative_to(output) or real == output:
            return False
        parts = real.relative_to(output).parts
        return parts[0] in (*OWN_FILES, self.private.name) or any(
            holds_result(output.joinpath(*parts[:depth])) for depth in range(1, len(parts) + 1)
        )

    def begin_objects(self, name: str) -> None:
        """Make the folders of a photo with a result for each object.

        Parameters
        ----------
        name : str
            Of the photo.
        """
        for folder in (self.output / name, self.output / THUMBNAILS / _EACH / name):
            folder.mkdir(parents=True, exist_ok=True)

    @contextmanager
    def locked(self, run: str) -> Iterator[None]:
        """Create and lock the folder, and clean up after killed runs.

        Parameters
        ----------
        run : str
            Identifier of the run.

        Returns
        -------
        context manager
            It holds the lock.

        Raises
        ------
        InputError
            If another process holds the lock, or the folder cannot be written.
        """
        # Imported here: an optional dependency of the extra `batch`, like Dask.
        from filelock import FileLock, Timeout

        self._make()
        with explained(self.lock):
            try:
                lock = FileLock(self.lock).acquire(blocking=False)
            except Timeout as error:
                owner = self.owner.read_text().strip() if self.owner.exists() else "unknown"
                raise InputError(
                    f"{self.output} is being written by another run ({owner}): wait until it ends"
                ) from error
        with lock:
            try:
                with explained(self.private):
                    self.owner.write_text(f"process {os.getpid()} on {socket.gethostname()}\n")
                    self._tidy()
                    self.run.write_text(run)
                yield
            finally:
                self.run.unlink(missing_ok=True)
                self._tidy()
                self.owner.unlink(missing_ok=True)

    def runs(self, run: str) -> bool:
        """Return whether this run holds the folder's lock now, as seen from this machine.

        Parameters
        ----------
        run : str
            Identifier of the run.

        Returns
        -------
        bool
        """
        try:
            return self.run.read_text() == run
        except OSError:
            return False

    def require_run(self, run: str) -> None:
        """Check that this machine has access to the folder of this run.

        Parameters
        ----------
        run : str
            Identifier of the run.

        Raises
        ------
        InputError
            If it does not.
        """
        if not self.runs(run):
            raise InputError(
                f"{self.output} is not the run's folder on {socket.gethostname()}: use one that "
                "all workers share"
            )

    def _make(self) -> None:
        if self.output.exists() and not self.output.is_dir():
            raise InputError(f"{self.output} is a file: choose a folder")
        if not self.private.is_dir() and (
            foreign := [name for name in OWN_FILES if (self.output / name).exists()]
        ):
            raise InputError(
                f"{self.output} has {foreign[0]}, which was not written by a batch: choose another "
                "folder"
            )
        try:
            for folder in (self.attempts, self.thumbnails):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"cannot write {self.output}: {error.strerror}; choose another folder"
            ) from error

    def _tidy(self) -> None:
        """Remove temporary siblings of results, and fetched copies.

        No other run writes here while the lock is held. Workers of a killed run may still process
        their last image; files that they write are locked.
        """
        for folder in (self.output, self.thumbnails, self.pages, *self._folders_of_objects()):
            remove_unfinished_in(folder)
        shutil.rmtree(self.fetched, ignore_errors=True)
        with contextlib.suppress(FileNotFoundError):
            for entry in os.scandir(self.attempts):
                Path(entry.path).unlink(missing_ok=True)

    def _folders_of_objects(self) -> Iterator[Path]:
        """Folders made by `begin_objects`; found by their thumbnails, as results are many."""
        with contextlib.suppress(FileNotFoundError):
            for entry in os.scandir(self.thumbnails / _EACH):
                yield Path(entry.path)
                yield self.output / entry.name
