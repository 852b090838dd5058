"""Terminal output and input: the progress bar, results, errors, and Ctrl-C."""

import contextlib
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import TextIO

from ...io.printable_names import readable
from ...progress import Monitor, ProgressEvent

_BAR = 24
_REDRAW_SECONDS = 0.08


def discard_output() -> None:
    """Redirect standard output to the null device, so that flushing at exit does not fail."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def printable(text: str, stream: TextIO) -> str:
    """Return a text in characters that a stream can encode.

    Parameters
    ----------
    text : str
        One or more lines.
    stream : TextIO

    Returns
    -------
    str
    """
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return (
        "\n".join(map(readable, text.split("\n")))
        .encode(encoding, "backslashreplace")
        .decode(encoding)
    )


class TerminalReporter:
    """Reports to a user: results on standard output, everything else on standard error."""

    @contextmanager
    def progress(self, quiet: bool) -> Iterator[Callable[[ProgressEvent], None]]:
        """Provide the receiver of progress events for the duration of the work.

        Parameters
        ----------
        quiet : bool
            Show no progress.

        Returns
        -------
        context manager of callable
            The receiver.
        """
        with ProgressBar(sys.stderr, quiet=quiet) as bar:
            yield bar

    def __enter__(self) -> "TerminalReporter":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        pass

    def done(self, output: str, lines: Sequence[str]) -> None:
        """Print the lines of a finished command.

        Parameters
        ----------
        output : str
            Path of the output; not printed.
        lines : sequence of str
        """
        del output
        for line in lines:
            print(printable(line, sys.stdout))

    def failed(self, message: str, code: int) -> None:
        """Print the error message of a failed command.

        Parameters
        ----------
        message : str
            Error message.
        code : int
            Exit code; not printed.
        """
        del code
        print(f"isc: error: {message}", file=sys.stderr)

    def rejected(self, lines: Sequence[str], code: int) -> None:
        """Print the violated bounds of a result.

        Parameters
        ----------
        lines : sequence of str
            One for each bound.
        code : int
            Exit code; not printed.
        """
        del code
        for line in lines:
            print(f"isc: rejected: {line}", file=sys.stderr)

    def cancelled(self) -> None:
        """Print that the command was cancelled."""
        print("isc: cancelled", file=sys.stderr)


class ProgressBar:
    """Show progress on `stream`: one line, redrawn, on a terminal; else a line for each new stage.

    Use as a context manager: the line is wiped at the end, however the work ends.

    Parameters
    ----------
    stream : text file
        Usually standard error.
    quiet : bool
        Show nothing.
    """

    def __init__(self, stream: TextIO, *, quiet: bool = False) -> None:
        self._stream = stream
        self._quiet = quiet
        self._terminal = stream.isatty()
        self._stage = ""
        self._fraction = 0.0
        self._last_draw = float("-inf")

    def __call__(self, event: ProgressEvent) -> None:
        """Show an event; the bar never moves backwards."""
        if self._quiet:
            return
        new, self._stage = event.stage != self._stage, event.stage
        self._fraction = max(self._fraction, min(event.fraction, 1.0))
        if self._terminal:
            self._draw(str(event), new)
        elif new:
            print(f"isc: {event.stage}", file=self._stream, flush=True)

    def _draw(self, text: str, new: bool) -> None:
        now = time.monotonic()
        if not new and now - self._last_draw < _REDRAW_SECONDS:
            return
        self._last_draw = now
        full = round(_BAR * self._fraction)
        line = f"[{'#' * full}{'.' * (_BAR - full)}] {100 * self._fraction:3.0f} %  {text}"
        self._stream.write(f"\r\x1b[K{line[: shutil.get_terminal_size().columns - 1]}")
        self._stream.flush()

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._last_draw > 0:
            with contextlib.suppress(OSError):
                self._stream.write("\r\x1b[K")
                self._stream.flush()


class Interrupts:
    """Ctrl-C and SIGTERM as cancellation.

    The first Ctrl-C asks the work to stop, a second one raises `KeyboardInterrupt`; SIGTERM ends
    the process with 143. All three let the work clean up. Nothing changes outside the main thread,
    and where Ctrl-C is ignored (`nohup`).
    """

    def __init__(self) -> None:
        self._cancelled = False
        self._previous: dict[int, object] = {}

    def monitor(self, progress: Callable[[ProgressEvent], None]) -> Monitor:
        """Return the monitor to work with.

        Parameters
        ----------
        progress : callable
            Receives `ProgressEvent`.

        Returns
        -------
        Monitor
            Cancelled by the first Ctrl-C.
        """
        return Monitor(progress, lambda: self._cancelled)

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        if self._cancelled:
            raise KeyboardInterrupt
        self._cancelled = True

    def __enter__(self) -> "Interrupts":
        if threading.current_thread() is threading.main_thread():
            self._install(signal.SIGINT, self._on_interrupt)
            self._install(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
        return self

    def _install(self, number: int, handler: Callable[[int, FrameType | None], object]) -> None:
        if signal.getsignal(number) != signal.SIG_IGN:
            self._previous[number] = signal.signal(number, handler)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._previous.items():
            # None: the handler was not installed from Python, and cannot be restored.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)  # type: ignore[arg-type]
