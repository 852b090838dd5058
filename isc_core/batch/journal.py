"""The outcomes of a run: an append-only file, read in input order at the end.

Every line is written immediately, so that the outcomes of a killed run are kept. Only 8 bytes per
image are kept in memory: the offset of its line.
"""

import json
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from types import TracebackType

from ..io.atomic import explained
from .item import FAILED, ImageOutcome
from .run_folder import RunFolder


@dataclass(frozen=True)
class JournalEntry:
    """The line of an image, or of one of its objects.

    Attributes
    ----------
    number : int
        Position in the inputs.
    name : str
        Of its result; "" for none.
    image, mask : str
        As given.
    outcome : ImageOutcome
    """

    number: int
    name: str
    image: str
    mask: str
    outcome: ImageOutcome

    def row(self) -> dict[str, object]:
        """Return the entry as a JSON-ready dictionary."""
        return {
            "number": self.number,
            "name": self.name,
            "image": self.image,
            "mask": self.mask,
            **asdict(self.outcome),
        }

    def failure(self) -> dict[str, object]:
        """Return the line of `failures.jsonl` as a JSON-ready dictionary."""
        row = self.row()
        return {name: row[name] for name in ("image", "mask", "name", "reason")}

    @staticmethod
    def of(row: dict[str, object]) -> "JournalEntry":
        """Return the entry of a row; the inverse of `row`.

        Parameters
        ----------
        row : dict of str to object
            From `row`.

        Returns
        -------
        JournalEntry
        """
        outcome = ImageOutcome(
            str(row["status"]),
            str(row["reason"]),
            float(str(row["seconds"])),
            float(str(row["peak_mb"])),
        )
        return JournalEntry(
            int(str(row["number"])), str(row["name"]), str(row["image"]), str(row["mask"]), outcome
        )


class Journal:
    """Collects entries in any order and returns them in input order; a context manager."""

    def __init__(self, folder: RunFolder, count: int) -> None:
        self.counts: Counter[str] = Counter()
        self.total = count  # of results known so far
        self._offsets = array("q", [-1]) * count
        self._files, self._path = ExitStack(), folder.journal
        with explained(folder.journal):
            self._all = self._files.enter_context(folder.journal.open("w+b"))
        with explained(folder.failures):
            self._failures = self._files.enter_context(folder.failures.open("wb"))

    def add(self, *entries: JournalEntry) -> None:
        """Write an image's lines; failures also go into `failures.jsonl`.

        Parameters
        ----------
        *entries : JournalEntry
            All of one image: one, or one for each object.

        Raises
        ------
        InputError
            If the disk is full.
        """
        with explained(self._path):
            self._write(entries)

    def _write(self, entries: Sequence[JournalEntry]) -> None:
        self._offsets[entries[0].number] = self._all.tell()
        self._all.write(b"".join(_line(entry.row()) for entry in entries))
        self._all.flush()
        self.counts.update(entry.outcome.status for entry in entries)
        self.total += len(entries) - 1
        for entry in entries:
            if entry.outcome.status == FAILED:
                self._failures.write(_line(entry.failure()))
                self._failures.flush()

    def entries(self) -> Iterator[JournalEntry]:
        """Iterate over all entries in input order."""
        for number, offset in enumerate(self._offsets):
            if offset >= 0:
                with explained(self._path):  # lines that did not fit are written again
                    self._all.seek(offset)
                yield from self._entries_of(number)
        with explained(self._path):
            self._all.seek(0, 2)

    def _entries_of(self, number: int) -> Iterator[JournalEntry]:
        """The entries of an image, from the present position of the file."""
        while line := self._all.readline():
            entry = JournalEntry.of(json.loads(line))
            if entry.number != number:
                return
            yield entry

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with explained(self._path):
            self._files.close()


def _line(row: Mapping[str, object]) -> bytes:
    """One line in ASCII, which preserves file names that are not UTF-8."""
    return json.dumps(row).encode("ascii") + b"\n"
