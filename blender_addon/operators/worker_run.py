"""One run: hand the images over, let a worker process do the work, take its result in; in steps
that never keep the window waiting.

A run is a generator ("script") whose every `next()` is one short call; `Run.step()` makes one such
call, measures it, and turns whatever happens into a `Status`. Nothing here knows windows or
operators, so it runs without either. The script owns the worker and closes it when it is closed
itself, which is all that cancelling takes; the run's own folder then goes, the result with it.
"""

import contextlib
import shutil
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from isc_core.errors import InputError

from ..worker.process import Update, Worker


@dataclass(frozen=True)
class Made:
    """What a script has made: a folder or a file, and what the worker had to say of it, one line or
    nothing.
    """

    path: Path
    notes: str = ""


Script = Generator[Update, None, Made]
"""Yields how far the work is, and returns what it made; raises `InputError` or `WorkFailed`."""

State = Literal["running", "ready", "done", "failed", "cancelled"]
_REMOVE_SECONDS = 5.0


@dataclass(frozen=True)
class Status:
    """How a run stands. `state`: "ready" means that the result can be taken in. `stage`: for
    people. `fraction`: of the work, in [0, 1]. `message`: how it ended, one line. `report`: the
    tail of the worker's log, if it failed.
    """

    state: State = "running"
    stage: str = "starting"
    fraction: float = 0.0
    message: str = ""
    report: str = ""


class WorkFailed(Exception):
    """The worker gave up.

    `args[0]`: one line for people. `report`: the tail of its log, or nothing.
    """

    def __init__(self, message: str, report: str = "") -> None:
        super().__init__(message)
        self.report = report


class Run:
    """One piece of work and the folder it may write to.

    `title`: what is being done. `folder`: the run's own, removed if the run does not end well; what
    is to be kept of it is the business of `finish`, which puts the result into the scene and
    returns a line for people. `status`: as it stands. `longest_call_ms`: of all calls but the one
    of `finish`; `import_ms`: of that one.
    """

    def __init__(
        self, title: str, script: Script, finish: Callable[[Any, Path], str], folder: Path
    ) -> None:
        self.title = title
        self.folder = folder
        self.status = Status()
        self.longest_call_ms = 0.0
        self.import_ms = 0.0
        self._script = script
        self._finish = finish
        self._made: Made | None = None

    @property
    def ended(self) -> bool:
        """Whether nothing more will happen."""
        return self.status.state in ("done", "failed", "cancelled")

    def step(self) -> Status:
        """Does what can be done at once and tells how far the run is.

        Never waits, never raises for what the work met.
        """
        if self.status.state == "running":
            began = time.perf_counter()
            self._advance()
            self.count(time.perf_counter() - began)
        return self.status

    def count(self, seconds: float) -> None:
        """Takes note of how long a call for this run has kept the window waiting."""
        self.longest_call_ms = max(self.longest_call_ms, 1e3 * seconds)

    def take_in(self, context: Any) -> Status:
        """Puts the result of a run that is ready into the scene: the one call that may take longer."""
        if self.status.state != "ready" or self._made is None:
            return self.status
        began = time.perf_counter()
        with self._ended_by_errors():
            said = self._finish(context, self._made.path)
            self._end("done", f"{said}; {self._made.notes}" if self._made.notes else said)
        self.import_ms = 1e3 * (time.perf_counter() - began)
        return self.status

    def cancel(self) -> Status:
        """Ends the run at once: the worker dies, its files go.

        Without effect on a run that has ended.
        """
        if not self.ended:
            self._end("cancelled", f"{self.title}: cancelled")
        return self.status

    def _advance(self) -> None:
        with self._ended_by_errors():
            try:
                said = next(self._script)
                self.status = Status("running", said.stage, said.fraction)
            except StopIteration as stop:
                self._made = stop.value
                self.status = Status("ready", "building the scene", 1.0)

    @contextlib.contextmanager
    def _ended_by_errors(self) -> Iterator[None]:
        """Ends the run with what went wrong; errors that nobody foresaw go on to Blender's console,
        but the run must not stay.
        """
        foreseen = False
        try:
            yield
            foreseen = True
        except InputError as error:
            foreseen = True
            self._end("failed", str(error))
        except WorkFailed as failure:
            foreseen = True
            self._end("failed", str(failure), failure.report)
        finally:
            if not foreseen:
                self._end(
                    "failed", f"an error of the extension, see the console: {sys.exception()}"
                )

    def _end(self, state: State, message: str, report: str = "") -> None:
        self._script.close()
        self.status = replace(self.status, state=state, stage="", message=message, report=report)
        if state != "done":
            remove(self.folder)


def follow(worker: Worker) -> Generator[Update, None, Update]:
    """Passes on what a worker says until it is done; returns its last update.

    Ends the worker when closed. Raises `WorkFailed`.
    """
    try:
        while (update := worker.poll()).state == "running":
            yield update
    finally:
        # Also after the worker has ended by itself: then there is nothing left to end.
        worker.kill()
    if update.state != "done":
        raise WorkFailed(update.message, update.report)
    return update


def during(stage: str, steps: Generator[None, None, Any]) -> Generator[Update, None, Any]:
    """Steps that say nothing, under the name of a stage; returns what they return."""
    try:
        while True:
            next(steps)
            yield Update(stage)
    except StopIteration as stop:
        return stop.value
    finally:
        steps.close()


def remove(folder: Path) -> None:
    """Removes a run's folder.

    A worker that was killed just now may still write to it, so a thread tries again for some
    seconds.
    """
    shutil.rmtree(folder, ignore_errors=True)
    if folder.exists():
        threading.Thread(target=_keep_removing, args=(folder,)).start()


def _keep_removing(folder: Path) -> None:
    end = time.monotonic() + _REMOVE_SECONDS
    while folder.exists() and time.monotonic() < end:
        time.sleep(0.05)
        shutil.rmtree(folder, ignore_errors=True)


# --- the run that goes on -------------------------------------------------------------------------

# There is one worker at most, as there is one machine: the process holds it, whichever window or
# file began it.
_going_on: list[Run] = []


def active() -> Run | None:
    """The run that goes on, or None."""
    return next((run for run in _going_on if not run.ended), None)


def begin(run: Run) -> Run:
    """Makes this the run that goes on.

    Raises `InputError`, and removes its folder, if there is one already.
    """
    present = active()
    if present is not None:
        run.cancel()
        raise InputError(f"{present.title} is going on: wait for it, or cancel it first")
    _going_on[:] = [run]
    return run


def require_idle() -> None:
    """Raises `InputError` while a run goes on."""
    present = active()
    if present is not None:
        raise InputError(f"{present.title} is going on: wait for it, or cancel it first")


def end_active() -> None:
    """Ends the run that goes on, if there is one: Blender is closed, or another file is loaded."""
    present = active()
    if present is not None:
        present.cancel()
