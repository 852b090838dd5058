"""The output folder of a batch: its lock, its files, and what killed runs left in it.

    OUT/NAME/                one result each, complete or absent
    OUT/thumbnails/NAME.jpg
    OUT/failures.jsonl       grows during a run
    OUT/summary.html, summary-pages/, summary.csv, summary.jsonl    written at the end
    OUT/.isc-batch/          lock, owner, run identifier, journal, attempts, fetched files

The lock (`filelock`) is the kernel's: it ends with its process in any case, so that no stale file
locks anybody out. `owner` beside it names the process that holds it.
"""

import contextlib
import os
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError
from ..io.atomic import remove_unfinished_in
from .names import OWN_FILES


class RunFolder:
    """The paths of an output folder, and operations on it as a whole."""

    def __init__(self, output: Path) -> None:
        self.output = output
        own = output / ".isc-batch"
        self.own, self.attempts, self.fetched = own, own / "attempts", own / "fetched"
        self.lock, self.owner = own / "lock", own / "owner"
        self.run, self.journal = own / "run", own / "journal.jsonl"
        self.failures = output / "failures.jsonl"
        self.thumbnails, self.pages = output / "thumbnails", output / "summary-pages"

    def thumbnail(self, name: str) -> Path:
        """Return the path of a result's thumbnail."""
        return self.thumbnails / f"{name}.jpg"

    @contextmanager
    def held(self, run: str) -> Iterator[None]:
        """Create and lock the folder, and clean up after killed runs.

        Parameters
        ----------
        run : str
            Identifier of the run.

        Raises
        ------
        InputError
            If another process holds the lock, or the folder cannot be written.
        """
        # Of the extra `batch`, as Dask: the other commands start without it.
        from filelock import FileLock, Timeout

        self._make()
        try:
            lock = FileLock(self.lock).acquire(blocking=False)
        except Timeout as error:
            owner = self.owner.read_text().strip() if self.owner.exists() else "unknown"
            raise InputError(
                f"{self.output} is being written by another run ({owner}): wait until it ends"
            ) from error
        with lock:
            self.owner.write_text(f"process {os.getpid()} on {socket.gethostname()}\n")
            self._tidy()
            self.run.write_text(run)
            try:
                yield
            finally:
                self.run.unlink(missing_ok=True)
                self._tidy()
                self.owner.unlink(missing_ok=True)

    def runs(self, run: str) -> bool:
        """Return whether this run holds the folder now, as seen from this machine."""
        try:
            return self.run.read_text() == run
        except OSError:
            return False

    def require_run(self, run: str) -> None:
        """Raise `InputError` if this machine does not see the folder of this run."""
        if not self.runs(run):
            raise InputError(
                f"{self.output} is not the run's folder on {socket.gethostname()}: give one that "
                "all workers share"
            )

    def _make(self) -> None:
        if self.output.exists() and not self.output.is_dir():
            raise InputError(f"{self.output} is a file: name a folder")
        if not self.own.is_dir() and (
            foreign := [name for name in OWN_FILES if (self.output / name).exists()]
        ):
            raise InputError(
                f"{self.output} holds {foreign[0]}, which no batch has written: choose another "
                "folder"
            )
        try:
            for folder in (self.attempts, self.thumbnails):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"cannot write {self.output}: {error.strerror}; choose another place"
            ) from error

    def _tidy(self) -> None:
        """Removes temporary siblings of results and what was fetched.

        No other run writes here, since the lock is held. Workers of a killed one may be at their
        last image: they hold what they write.
        """
        for folder in (self.output, self.thumbnails, self.pages):
            remove_unfinished_in(folder)
        shutil.rmtree(self.fetched, ignore_errors=True)
        with contextlib.suppress(FileNotFoundError):
            for entry in os.scandir(self.attempts):
                Path(entry.path).unlink(missing_ok=True)
