"""Detection of images that hang or crash their worker.

Problem: a worker may die while it decomposes an image (out of memory, a fault in a library); the
scheduler then gives the image to the next worker, which may die as well. A step may never return,
so that no flag is checked. No surviving process knows which image was the cause, and why.

Method: a task first writes a line into a file of its image, and removes the file when it ends in
any regular way. If the file exists when a task begins, its lines are the number of workers lost on
this image. With a time limit a watchdog runs alongside the task: Python's `faulthandler`, whose
thread needs no interpreter lock. At the limit it writes a traceback into the same file and ends the
process. The task that gets the image next reads it, and reports it instead of trying again.

Limits: one image at a time in a process. The steps check the clock themselves first; the watchdog
allows a little more.
"""

import faulthandler
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError
from ..progress import Monitor

MAX_CRASHES = 3
_MARK = "Timeout ("  # prefix of faulthandler's report


@contextmanager
def attempt(path: Path, run: str, timeout: float) -> Iterator[Monitor]:
    """Provide a monitor that cancels the work after a time limit.

    Parameters
    ----------
    path : Path
        The image's record.
    run : str
        Identifier of the run.
    timeout : float
        Seconds; 0 for no limit.

    Returns
    -------
    Monitor
        For the duration of the block.

    Raises
    ------
    InputError
        If this image has hung, or has cost `MAX_CRASHES` workers, in this run.
    """
    _reject_crashing(path, run, timeout)
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
    """Return the time that a worker is allowed beyond the limit: one interval of clock checks.

    Parameters
    ----------
    timeout : float
        Time limit per image, in seconds.

    Returns
    -------
    float
        Seconds.
    """
    return min(max(0.1 * timeout, 1.0), 10.0)


def _reject_crashing(path: Path, run: str, timeout: float) -> None:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return
    if run not in lines:  # left by a killed run, whose cause is unknown
        path.unlink(missing_ok=True)
        return
    hung = any(line.startswith(_MARK) for line in lines)
    if not hung and lines.count(run) < MAX_CRASHES:
        return
    path.unlink(missing_ok=True)
    if hung:
        raise InputError(
            f"exceeded --timeout {timeout:g} s and did not respond{_location(lines)}: its "
            "worker was stopped"
        )
    raise InputError(
        f"{MAX_CRASHES} workers crashed while processing it: it may need more memory than "
        "--memory gives"
    )


def _location(lines: list[str]) -> str:
    """The innermost frame of the first thread that ran `process`, as text."""
    thread = None
    for number, line in enumerate(lines):
        if line.startswith(("Thread", "Current thread")):
            thread = number
        if "in process" in line and "work.py" in line:
            break
    else:
        return ""
    if thread is None:
        return ""
    frame = lines[thread + 1].strip().removeprefix("File ")
    return f" (in {frame.rpartition(' in ')[2]})"
