"""How long work reports its progress and learns that it should stop.

The core receives one `progress(stage, fraction)` and one `cancelled()`; terminals, panels and batch
runners adapt them.
"""

from collections.abc import Callable
from dataclasses import dataclass

from .errors import Cancelled


def _ignore(stage: str, fraction: float) -> None:
    del stage, fraction


def _never() -> bool:
    return False


@dataclass(frozen=True)
class Monitor:
    """The pair of callbacks that goes through the core.

    `progress(stage, fraction)`: a stage's text for people, and how much of the whole job is done,
    in [0, 1]. `cancelled()`: true once the user wants to stop.
    """

    progress: Callable[[str, float], None] = _ignore
    cancelled: Callable[[], bool] = _never

    def report(self, stage: str, fraction: float) -> None:
        """Passes progress on. Raises `Cancelled` when the user asked to stop."""
        if self.cancelled():
            raise Cancelled(stage)
        self.progress(stage, fraction)

    def part(self, start: float, end: float) -> "Monitor":
        """A monitor whose [0, 1] is the range [start, end] of this one."""
        return Monitor(
            lambda stage, f: self.progress(stage, start + (end - start) * f), self.cancelled
        )
