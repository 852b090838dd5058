"""Progress and cancellation of long work.

The core receives one `Monitor`, to which it reports `ProgressEvent` objects and which it polls for
cancellation. Terminals, Blender's panels and batch runners adapt it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from .errors import Cancelled


@dataclass(frozen=True)
class ProgressEvent:
    """The progress of a job.

    Attributes
    ----------
    stage : str
        Name of the current stage; constant while the stage lasts.
    fraction : float
        Completed share of the whole job, in [0, 1].
    detail : str
        Details that change within the stage, such as the loss or the time left; may be empty.
    part : (int, int) or None
        For several photos or objects: the number of the current one, from 1, and the total.
    """

    stage: str
    fraction: float
    detail: str = ""
    part: tuple[int, int] | None = None

    def __str__(self) -> str:
        return f"{self.stage}, {self.detail}" if self.detail else self.stage


def _ignore(event: ProgressEvent) -> None:
    del event


def _never() -> bool:
    return False


@dataclass(frozen=True)
class Monitor:
    """The pair of callbacks that is passed through the core.

    Attributes
    ----------
    progress : callable
        Receives a `ProgressEvent`.
    cancelled : callable
        Returns True once the user has cancelled.
    """

    progress: Callable[[ProgressEvent], None] = _ignore
    cancelled: Callable[[], bool] = _never

    def report(self, stage: str, fraction: float, detail: str = "") -> None:
        """Send a `ProgressEvent`.

        Parameters
        ----------
        stage, fraction, detail
            See `ProgressEvent`.

        Raises
        ------
        Cancelled
            If the user has cancelled.
        """
        if self.cancelled():
            raise Cancelled(stage)
        self.progress(ProgressEvent(stage, fraction, detail))

    def part(self, start: float, end: float) -> "Monitor":
        """Return a monitor of a part of this one's work.

        Parameters
        ----------
        start, end : float
            Fractions of this monitor that correspond to 0 and 1 of the part.

        Returns
        -------
        Monitor
        """

        def scaled(event: ProgressEvent) -> None:
            self.progress(replace(event, fraction=start + (end - start) * event.fraction))

        return Monitor(scaled, self.cancelled)
