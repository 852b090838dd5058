"""Images that hang, or take their worker with them.

Problem: a worker may die under an image (memory, a fault in a library), and the scheduler gives the
image to the next one, which may die as well. A step may never return, so that no flag is looked at.
Which image it was, and why, is known to nobody who is left.

Way: a task first writes a line into a file of its image, and removes the file when it ends, however
it ends. Who finds the file knows that workers were lost on this image, and how many. With a time
limit a watchdog waits beside the task, Python's `faulthandler`, whose thread needs no interpreter
lock: at the limit it writes where the task stands into the same file and ends the process. The task
that is given the image next reads that, and reports it instead of trying again.

Limits: one image at a time in a process. The steps look at the clock themselves first; the watchdog
grants them a little more.
"""

import faulthandler
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError
from ..progress import Monitor

MOST_LOST = 3
_MARK = "Timeout ("  # how faulthandler opens its report


@contextmanager
def attempt(path: Path, run: str, timeout: float) -> Iterator[Monitor]:
    """Gives the monitor to work with, which says stop after `timeout` seconds (0: never); `path`:
    of the image's record.

    Raises `InputError` where this image has hung, or has cost `MOST_LOST` workers, in this `run`.
    """
    _refuse_what_kills(path, run, timeout)
    try:
        with path.open("a", encoding="utf-8") as record:
            record.write(f"{run}\n")
            record.flush()
            if timeout:
                faulthandler.dump_traceback_later(timeout + grace(timeout), exit=True, file=record)
            deadline = time.monotonic() + timeout
            try:
                yield Monitor(cancelled=lambda: bool(timeout) and time.monotonic() > deadline)
            finally:
                if timeout:
                    faulthandler.cancel_dump_traceback_later()
    finally:
        path.unlink(missing_ok=True)


def grace(timeout: float) -> float:
    """Seconds beyond the limit before a worker is ended: the time from one look at the clock to the
    next.
    """
    return min(max(0.1 * timeout, 1.0), 10.0)


def _refuse_what_kills(path: Path, run: str, timeout: float) -> None:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return
    if run not in lines:  # of a run that was killed: that may have been anything
        path.unlink(missing_ok=True)
        return
    hung = any(line.startswith(_MARK) for line in lines)
    if not hung and lines.count(run) < MOST_LOST:
        return
    path.unlink(missing_ok=True)
    if hung:
        raise InputError(
            f"took longer than --timeout {timeout:g} s and did not react{_place(lines)}: its worker was ended"
        )
    raise InputError(
        f"{MOST_LOST} workers were lost while they worked on it: it may need more memory than --memory gives"
    )


def _place(lines: list[str]) -> str:
    """Where the task stood: the innermost line of the first thread that was in this package's work."""
    own = [
        number for number, line in enumerate(lines) if "in process" in line and "work.py" in line
    ]
    if not own:
        return ""
    first = max(
        (
            number
            for number in range(own[0])
            if lines[number].startswith(("Thread", "Current thread"))
        ),
        default=None,
    )
    if first is None:
        return ""
    where = lines[first + 1].strip().removeprefix("File ")
    return f" (in {where.rpartition(' in ')[2]})"
