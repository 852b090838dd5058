"""The protocol of `isc --progress json`: one JSON object per line on standard output.

    {"event": "progress", "stage": "shape and light", "fraction": 0.42, "detail": "loss 46.100"}
    {"event": "done", "output": "cup", "lines": ["look at cup/preview.png"]}
    {"event": "failed", "message": "one line for users", "code": 2}
    {"event": "cancelled"}

Any number of progress events comes first; their fraction, of the whole job, never decreases; for
several photos or objects they have a `part`, [2, 3] for the second of three. One of the other three
events comes last.

The calling program writes to standard input: the line `cancel` acts as Ctrl-C. With
`--cancel-at-eof` so does the end of the stream, which occurs when that program ends; without it, a
command with an empty standard input (cron, CI) continues. The work is first cancelled at its next
step; after a second it is interrupted; both let it clean up. Ten seconds later the process ends in
any case. Notes for users, and the traceback of a bug, are written to standard error.

Limits: a process without standard input cannot be cancelled. Readers should ignore lines of
standard output that are not JSON.
"""

import _thread
import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import TextIO

from ...progress import ProgressEvent
from .terminal import Verbosity, discard_output

_REPEAT_SECONDS = 0.05
GRACE_SECONDS = (1.0, 10.0)  # seconds to wait after the first and the second interrupt
_CANCELLED = 130


class JsonReporter:
    """Reports to a program.

    As a context manager inside `Interrupts`, in the main thread of the process, it lets the program
    cancel.

    Parameters
    ----------
    stream : text file
        Usually standard output.
    cancel_at_eof : bool
        Whether the end of standard input cancels, too.
    """

    def __init__(self, stream: TextIO, *, cancel_at_eof: bool = False) -> None:
        self._stream = stream
        self._cancel_at_eof = cancel_at_eof
        self._stage, self._most, self._reported = "", 0.0, float("-inf")
        self._ended = threading.Event()
        self._lock = threading.Lock()

    @contextmanager
    def progress(self, verbosity: Verbosity) -> Iterator[Callable[[ProgressEvent], None]]:
        """Provide the receiver of progress events.

        Parameters
        ----------
        verbosity : Verbosity
            Without effect: progress is reported even with --quiet.

        Returns
        -------
        context manager of callable
            The receiver.
        """
        del verbosity
        yield self._step

    def done(self, output: str, lines: Sequence[str]) -> None:
        """Report the output of a finished command.

        Parameters
        ----------
        output : str
            Path of the output.
        lines : sequence of str
            Lines of the command.
        """
        self._write("done", output=output, lines=list(lines))

    def failed(self, message: str, code: int) -> None:
        """Report the error message and exit code of a failed command.

        Parameters
        ----------
        message : str
            Error message.
        code : int
            Exit code.
        """
        self._write("failed", message=message, code=code)

    def rejected(self, lines: Sequence[str], code: int, done: Sequence[str] = ()) -> None:
        """Report the violated bounds of a result.

        Parameters
        ----------
        lines : sequence of str
            One for each bound.
        code : int
            Exit code.
        done : sequence of str, optional
            Lines about completed parts; not reported, since they are in the results, too.
        """
        del done
        self._write("failed", message="; ".join(lines), code=code)

    def cancelled(self, hint: str = "") -> None:
        """Report that the command was cancelled.

        Parameters
        ----------
        hint : str, optional
            For users; not reported.
        """
        del hint
        self._write("cancelled")

    def _step(self, event: ProgressEvent) -> None:
        now = time.monotonic()
        self._most = max(self._most, min(event.fraction, 1.0))
        if event.stage != self._stage or now - self._reported > _REPEAT_SECONDS:
            self._stage, self._reported = event.stage, now
            part = {} if event.part is None else {"part": event.part}
            self._write(
                "progress",
                stage=event.stage,
                fraction=round(self._most, 4),
                detail=event.detail,
                **part,
            )

    def _write(self, event: str, **content: object) -> None:
        try:
            self._stream.write(json.dumps({"event": event, **content}) + "\n")
            self._stream.flush()
        except OSError:  # the reader has ended: the end of standard input then cancels the work
            discard_output()

    def __enter__(self) -> "JsonReporter":
        if (descriptor := _standard_input()) is not None:
            threading.Thread(
                target=self._watch, args=(descriptor,), name="isc-cancel", daemon=True
            ).start()
        self._step(ProgressEvent("starting", 0.0))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._lock:  # no more interrupts, so that the last event is written
            self._ended.set()

    def _watch(self, descriptor: int) -> None:
        if not _await_cancel(descriptor) and not self._cancel_at_eof:
            return
        for grace in GRACE_SECONDS:
            with self._lock:
                if self._ended.is_set():
                    return
                _thread.interrupt_main()
            self._ended.wait(grace)
        if not self._ended.is_set():
            os._exit(_CANCELLED)


def _standard_input() -> int | None:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # there is none, or it is not a file
        return None


def _await_cancel(descriptor: int) -> bool:
    """Return True after the line `cancel`, False at the end of the file; reads the descriptor
    directly, because the lock of Python's buffer would outlive this thread.
    """
    text = b""
    while b"cancel" not in (line.strip() for line in text.split(b"\n")[:-1]):
        try:
            block = os.read(descriptor, 4096)
        except OSError:
            return False
        if not block:
            return False
        text = text.rpartition(b"\n")[2] + block
    return True
