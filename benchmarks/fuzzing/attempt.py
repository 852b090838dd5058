"""One damaged file and one reader: what came of it, and what is wrong with that.

A reader may return or raise `InputError` with one line. Everything else is a finding: another
exception, a line with something in it that steers a terminal, anything printed, memory that ran out
under the limit of the process (even where the reader says so politely).
"""

import os
import random
import traceback
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from isc_core.errors import InputError

from .case import Case, Target
from .mutation import mutated

_OURS = ("isc_core", "synth", "blender_addon")
_NO_MEMORY = ("nsufficient memory", "bad_alloc", "bad alloc", "Cannot allocate")


@dataclass(frozen=True)
class Finding:
    """`kind`: "exception", "crash", "hang", "memory", "noise" or "text".

    `place`: where, the same for the same fault. `detail`: a line.
    """

    kind: str
    place: str
    detail: str

    @property
    def signature(self) -> str:
        """The same for the same fault."""
        return f"{self.kind} {self.place}"


class _Caught:
    """Holds what a reader raises, whatever it is."""

    def __init__(self) -> None:
        self.error: BaseException | None = None

    def __enter__(self) -> "_Caught":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        del kind, trace
        self.error = error
        return not isinstance(error, KeyboardInterrupt)


def case_and_data(
    target: Target, cases: Sequence[Case], seed: int, number: int
) -> tuple[Case, bytes]:
    """The input of that number: always the same for the same seed. `cases`: those of the target."""
    rng = random.Random(f"{seed}/{target.name}/{number}")
    case = rng.choice(cases)
    others = [other.data for other in cases if other.name == case.name and other.wrap is case.wrap]
    return case, mutated(rng, case.data, others, target.words)


def put(case: Case, folder: Path, data: bytes) -> Path:
    """Writes the case's files, the damaged one among them, into a folder; returns its path."""
    path = folder / case.name
    for name, content in (*case.beside.items(), (case.name, case.wrap(data))):
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    return path


def attempt(case: Case, path: Path, printed: int) -> tuple[bool, Finding | None]:
    """Reads the file; whether it was refused, and what is wrong.

    `printed`: the descriptor that holds what is printed; it is emptied.
    """
    with _Caught() as caught:
        case.read(path)
    error = caught.error
    refused = isinstance(error, InputError)
    if error is not None and not refused:
        kind = "memory" if isinstance(error, MemoryError) else "exception"
        return False, Finding(kind, f"{type(error).__name__} {_place(error)}", _line(error))
    if size := os.fstat(printed).st_size:
        text = os.pread(printed, min(size, 300), 0).decode("utf-8", "replace")
        os.ftruncate(printed, 0)
        os.lseek(printed, 0, os.SEEK_SET)
        return refused, Finding("noise", case.name, " ".join(text.split()))
    if error is not None and (cause := _out_of_memory(error)) is not None:
        return refused, Finding("memory", f"{type(cause).__name__} {_place(cause)}", _line(error))
    if error is not None and not str(error).isprintable():
        return refused, Finding("text", _place(error), _line(error))
    return refused, None


def minimised(
    data: bytes, finds: Finding, again: Callable[[bytes], Finding | None], tries: int
) -> bytes:
    """Smaller data with the same finding: parts are taken out while it stays.

    `again(data)` gives the finding of other data, or None.
    """
    size = max(len(data) // 2, 1)
    while tries > 0 and size >= 1:
        at = 0
        while at < len(data) and tries > 0:
            shorter = data[:at] + data[at + size :]
            tries -= 1
            found = again(shorter)
            if found is not None and found.signature == finds.signature:
                data = shorter
            else:
                at += size
        size //= 2
    return data


def _place(error: BaseException) -> str:
    """Where it was raised, and from where in our code that was called; without lines, which change."""
    frames = traceback.extract_tb(error.__traceback__)
    if not frames:
        return "nowhere"
    ours = [
        frame for frame in frames if any(f"/{package}/" in frame.filename for package in _OURS)
    ] or frames
    return " < ".join(
        dict.fromkeys(
            f"{Path(frame.filename).name}:{frame.name}" for frame in (frames[-1], ours[-1])
        )
    )


def _out_of_memory(error: BaseException) -> BaseException | None:
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError) or any(word in str(cause) for word in _NO_MEMORY):
            return cause
        cause = cause.__cause__ or cause.__context__
    return None


def _line(error: BaseException) -> str:
    return ascii(str(error))[:300]


def checksum(text: str) -> str:
    """Eight hexadecimal digits that name a finding's folder."""
    return f"{zlib.crc32(text.encode()):08x}"
