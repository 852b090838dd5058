"""Terminal output: the progress bar, results and errors.

Colours are used only on terminals, and not if the environment has `NO_COLOR` (no-color.org) or
`TERM=dumb`; `FORCE_COLOR` enables them anywhere.
"""

import contextlib
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum
from types import TracebackType
from typing import TextIO

from ...io.printable_names import readable
from ...progress import ProgressEvent

_BAR = 24
_REDRAW_SECONDS = 0.08
_WIPE = "\r\x1b[K"  # to the start of the line, and erase it


class Verbosity(Enum):
    """The amount of output besides the result.

    Attributes
    ----------
    QUIET
        Nothing.
    NORMAL
        Progress.
    VERBOSE
        A line for each stage, with the time since the start.
    """

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2


class Style(Enum):
    """The look of a word: a parameter of the terminal's escape sequence.

    Attributes
    ----------
    ERROR
        Bold red.
    NOTE
        Bold cyan.
    """

    ERROR = "1;31"
    NOTE = "1;36"


def styled(text: str, style: Style, stream: TextIO) -> str:
    """Return a text in the style that `stream` supports.

    Parameters
    ----------
    text : str
    style : Style
    stream : TextIO

    Returns
    -------
    str
        With escape sequences if the stream is a terminal with colours.
    """
    environment = os.environ
    if environment.get("NO_COLOR"):
        return text
    capable = stream.isatty() and environment.get("TERM") != "dumb"
    if not capable and not environment.get("FORCE_COLOR"):
        return text
    return f"\x1b[{style.value}m{text}\x1b[0m"


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


def print_note(line: str, stream: TextIO) -> None:
    """Print a line during the work.

    On a terminal it replaces the progress bar, which the next event redraws below.

    Parameters
    ----------
    line : str
    stream : TextIO
        Usually standard error.
    """
    wipe = _WIPE if stream.isatty() else ""
    print(f"{wipe}isc: {printable(line, stream)}", file=stream, flush=True)


class TerminalReporter:
    """Reports to a user: results on standard output, all else on standard error."""

    @contextmanager
    def progress(self, verbosity: Verbosity) -> Iterator[Callable[[ProgressEvent], None]]:
        """Provide the receiver of progress events for the duration of the work.

        Parameters
        ----------
        verbosity : Verbosity

        Returns
        -------
        context manager of callable
            The receiver.
        """
        quiet, verbose = verbosity is Verbosity.QUIET, verbosity is Verbosity.VERBOSE
        with ProgressBar(sys.stderr, quiet=quiet, verbose=verbose) as bar:
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
        print(f"isc: {styled('error:', Style.ERROR, sys.stderr)} {message}", file=sys.stderr)

    def rejected(self, lines: Sequence[str], code: int, done: Sequence[str] = ()) -> None:
        """Print the violated bounds of a result.

        Parameters
        ----------
        lines : sequence of str
            One for each bound.
        code : int
            Exit code; not printed.
        done : sequence of str, optional
            Lines about completed parts.
        """
        self.done("", done)
        for line in lines:
            print(f"isc: {styled('rejected:', Style.ERROR, sys.stderr)} {line}", file=sys.stderr)

    def cancelled(self, hint: str = "") -> None:
        """Print that the command was cancelled.

        Parameters
        ----------
        hint : str, optional
            How the user can go on.
        """
        print(f"isc: cancelled; {hint}" if hint else "isc: cancelled", file=sys.stderr)


class ProgressBar:
    """Show progress on `stream`: one line, redrawn, on a terminal; else a line for each new stage.

    Use as a context manager: the line is erased at the end, however the work ends.

    Parameters
    ----------
    stream : text file
        Usually standard error.
    quiet : bool
        Show nothing.
    verbose : bool
        Show a line for each new stage with the seconds since the start, also on a terminal.
    """

    def __init__(self, stream: TextIO, *, quiet: bool = False, verbose: bool = False) -> None:
        self._stream = stream
        self._quiet = quiet
        self._started = time.monotonic() if verbose else None
        self._terminal = stream.isatty() and not verbose
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
            now = time.monotonic()
            seconds = "" if self._started is None else f"{now - self._started:7.2f} s  "
            print(f"isc: {seconds}{event.stage}", file=self._stream, flush=True)

    def _draw(self, text: str, new: bool) -> None:
        now = time.monotonic()
        if not new and now - self._last_draw < _REDRAW_SECONDS:
            return
        self._last_draw = now
        full = round(_BAR * self._fraction)
        line = f"[{'#' * full}{'.' * (_BAR - full)}] {100 * self._fraction:3.0f} %  {text}"
        self._stream.write(f"{_WIPE}{line[: shutil.get_terminal_size().columns - 1]}")
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
                self._stream.write(_WIPE)
                self._stream.flush()
