"""Cancellation by Ctrl-C and SIGTERM.

The first Ctrl-C sets a flag that is checked between steps of the work; a second one raises
`KeyboardInterrupt`. A flag cannot get lost, whereas libraries that catch all exceptions of an
import (trimesh does) would swallow an exception. A cancelled run always ends as cancelled, whatever
else happens.
"""

import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType, TracebackType

from ...errors import Cancelled
from ...progress import Monitor, ProgressEvent


class Interrupts:
    """Context in which Ctrl-C cancels the work, and SIGTERM ends the process with 143.

    Both let the work clean up. Without effect outside the main thread.

    Parameters
    ----------
    even_if_ignored : bool
        Handle Ctrl-C even if the process inherited that it is ignored, as under `nohup`.

    Raises
    ------
    Cancelled
        At the end of the context, if Ctrl-C was pressed in it before `finish`.
    """

    def __init__(self, *, even_if_ignored: bool = False) -> None:
        self._even_if_ignored = even_if_ignored
        self._cancelled = False
        self._finished = False
        self._terminated = 0
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

    def check(self) -> None:
        """Raise `Cancelled` if Ctrl-C was pressed."""
        if self._cancelled:
            raise Cancelled

    def finish(self) -> None:
        """Mark the work as finished: Ctrl-C is ignored from now on.

        Raises
        ------
        Cancelled
            If Ctrl-C was pressed before.
        """
        self._finished = True
        self.check()

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        if self._finished:
            return
        if self._cancelled:
            raise KeyboardInterrupt
        self._cancelled = True

    def _on_termination(self, number: int, frame: FrameType | None) -> None:
        self._terminated = 128 + number
        sys.exit(self._terminated)

    def __enter__(self) -> "Interrupts":
        if threading.current_thread() is threading.main_thread():
            self._install(signal.SIGINT, self._on_interrupt, self._even_if_ignored)
            self._install(signal.SIGTERM, self._on_termination)
        return self

    def _install(
        self, number: int, handler: Callable[[int, FrameType | None], object], always: bool = False
    ) -> None:
        if always or signal.getsignal(number) != signal.SIG_IGN:
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
        if self._terminated and not isinstance(value, SystemExit):
            raise SystemExit(self._terminated) from value
        if self._cancelled and not isinstance(value, Cancelled | KeyboardInterrupt | SystemExit):
            raise Cancelled from value
