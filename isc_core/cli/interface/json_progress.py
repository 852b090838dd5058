"""The protocol of `isc --progress json`: one JSON object a line on standard output.

    {"event": "progress", "stage": "shape and light", "fraction": 0.42, "detail": "loss 46.100"}
    {"event": "done", "output": "cup", "lines": ["look at cup/preview.png"]}
    {"event": "failed", "message": "one line for people", "code": 2}
    {"event": "cancelled"}

Any number of progress events comes first; their fraction, of the whole job, never decreases. One of
the other three comes last.

The calling program holds the other end of standard input: the line `cancel`, or the end of the
stream because that program has ended, acts as Ctrl-C. The work is asked to stop; after a second it
is interrupted wherever it is; both let it clean up. Ten seconds later the process ends in any case.
Notes for people, and the traceback of a bug, go to standard error.

Limits: a process without standard input is not watched. Ignore lines of standard output that are
not JSON.
"""

import _thread
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import TextIO

from ...progress import ProgressEvent
from .terminal import discard_output

_REPEAT_SECONDS = 0.05
PATIENCE_SECONDS = (1.0, 10.0)  # after asking, after interrupting
_CANCELLED = 130


class JsonSpeaker:
    """Reports to a program.

    As a context manager, in the main thread of the process, it lets the program cancel by
    `KeyboardInterrupt`.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._stage, self._most, self._told = "", 0.0, float("-inf")
        self._ended = threading.Event()
        self._turn = threading.Lock()
        self._before: object = None

    @contextmanager
    def progress(self, quiet: bool) -> Iterator[Callable[[ProgressEvent], None]]:
        """Provide the receiver of progress events; it reports even with --quiet."""
        del quiet
        yield self._step

    def done(self, output: str, lines: Sequence[str]) -> None:
        """Report the output of a finished command."""
        self._say("done", output=output, lines=list(lines))

    def failed(self, message: str, code: int) -> None:
        """Report the error message and exit code of a failed command."""
        self._say("failed", message=message, code=code)

    def rejected(self, lines: Sequence[str], code: int) -> None:
        """Report the violated bounds of a result."""
        self._say("failed", message="; ".join(lines), code=code)

    def cancelled(self) -> None:
        """Report that the command was cancelled."""
        self._say("cancelled")

    def _step(self, event: ProgressEvent) -> None:
        now = time.monotonic()
        self._most = max(self._most, min(event.fraction, 1.0))
        if event.stage != self._stage or now - self._told > _REPEAT_SECONDS:
            self._stage, self._told = event.stage, now
            self._say(
                "progress",
                stage=event.stage,
                fraction=round(self._most, 4),
                detail=event.detail,
            )

    def _say(self, event: str, **content: object) -> None:
        try:
            self._stream.write(json.dumps({"event": event, **content}) + "\n")
            self._stream.flush()
        except (
            OSError
        ):  # nobody listens any more: the end of standard input says so too, and stops the work
            discard_output()

    def __enter__(self) -> "JsonSpeaker":
        if (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) == signal.SIG_IGN
        ):
            # A program in the background hands on that Ctrl-C is ignored, but here no terminal
            # asks.
            self._before = signal.signal(signal.SIGINT, signal.default_int_handler)
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
        with self._turn:  # from here on nothing is interrupted, so that the last word is heard
            self._ended.set()
        if self._before is not None:
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    def _watch(self, descriptor: int) -> None:
        _await_cancel(descriptor)
        for patience in PATIENCE_SECONDS:
            with self._turn:
                if self._ended.is_set():
                    return
                _thread.interrupt_main()
            self._ended.wait(patience)
        if not self._ended.is_set():
            os._exit(_CANCELLED)


def _standard_input() -> int | None:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # there is none, or it is no file
        return None


def _await_cancel(descriptor: int) -> None:
    """Returns once the line `cancel` or the end of the file was read, past Python's buffer: its
    lock would outlive this thread.
    """
    text = b""
    while b"cancel" not in (line.strip() for line in text.split(b"\n")[:-1]):
        try:
            block = os.read(descriptor, 4096)
        except OSError:
            return
        if not block:
            return
        text = text.rpartition(b"\n")[2] + block
