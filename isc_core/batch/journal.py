"""The outcomes of a run: an append-only file, read in input order at the end.

Every line is written at once, so that a killed run keeps what it knew. Of each image 8 bytes are
kept in memory: the offset of its line.
"""

import json
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from types import TracebackType

from .item import FAILED, ImageOutcome
from .run_folder import RunFolder


@dataclass(frozen=True)
class JournalEntry:
    """One image's line.

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

    @staticmethod
    def of(row: dict[str, object]) -> "JournalEntry":
        """Return the entry of a row; the inverse of `row`.

        Parameters
        ----------
        row : dict of str to object
            As `row` returns it.

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
        self.total = count
        self._offsets = array("q", [-1]) * count
        self._files = ExitStack()
        self._all = self._files.enter_context(folder.journal.open("w+b"))
        self._failures = self._files.enter_context(folder.failures.open("wb"))

    def add(self, entry: JournalEntry) -> None:
        """Write an image's line; a failure also goes into `failures.jsonl`.

        Parameters
        ----------
        entry : JournalEntry
        """
        self._offsets[entry.number] = self._all.tell()
        self._all.write(_line(entry.row()))
        self._all.flush()
        self.counts[entry.outcome.status] += 1
        if entry.outcome.status == FAILED:
            row = {
                "image": entry.image,
                "mask": entry.mask,
                "name": entry.name,
                "reason": entry.outcome.reason,
            }
            self._failures.write(_line(row))
            self._failures.flush()

    def entries(self) -> Iterator[JournalEntry]:
        """Iterate over all entries in input order."""
        for offset in self._offsets:
            if offset >= 0:
                self._all.seek(offset)
                yield JournalEntry.of(json.loads(self._all.readline()))
        self._all.seek(0, 2)

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._files.close()


def _line(row: Mapping[str, object]) -> bytes:
    """One line in ASCII, which preserves file names that are not UTF-8."""
    return json.dumps(row).encode("ascii") + b"\n"
