"""One run: export the images, let a worker process them, import its result, in short steps.

A run is driven by a generator of steps, each `next()` of which is one short call.
`WorkerRun.step()` makes one such call, measures it, and turns the outcome into a `RunStatus`.
Nothing here depends on windows or operators. The generator owns the worker and ends it when it is
closed, so closing it is all that cancelling takes. The run's folder is then deleted, with the
result in it.
"""

import contextlib
import shutil
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from isc_core.errors import InputError

from ..scene.preparation import PreparedObject
from ..worker.process import WorkerProcess, WorkerState, WorkerUpdate


@dataclass(frozen=True)
class RunOutput:
    """What a run has produced.

    Attributes
    ----------
    path : Path
        File or folder.
    notes : tuple of str
        Notes on the result; those that advise something begin with "note: ".
    prepared : tuple of PreparedObject
        What is built from the folder, if it was read; one entry per object.
    remark : str
        Addition to the message on the outcome; "" for none.
    """

    path: Path
    notes: tuple[str, ...] = ()
    prepared: tuple[PreparedObject, ...] = ()
    remark: str = ""


RunSteps = Generator[WorkerUpdate, None, RunOutput]
"""Yields progress and returns the output; raises `InputError` or `WorkerFailed`."""

ImportSteps = Generator[None, None, str]
"""Imports an output in short steps and returns one line on it; raises `InputError`."""

IMPORT_SECONDS = 0.005  # of import steps per tick; a longer step has a tick of its own

_REMOVE_SECONDS = 5.0


class RunState(StrEnum):
    """State of a run; READY means that the result can be imported."""

    RUNNING = "running"
    READY = "ready"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


@dataclass(frozen=True)
class RunStatus:
    """Progress and outcome of a run.

    Attributes
    ----------
    state : RunState
        State of the run.
    stage : str
        Name of the current stage, for display.
    fraction : float
        Share of the work that is done, in [0, 1].
    message : str
        The outcome, one line.
    notes : tuple of str
        Notes on the result; those that advise something begin with "note: ".
    log : str
        Last part of the worker's log, if it failed.
    seconds_left : float or None
        Estimate of the time until the end.
    """

    state: RunState = RunState.RUNNING
    stage: str = "starting"
    fraction: float = 0.0
    message: str = ""
    notes: tuple[str, ...] = ()
    log: str = ""
    seconds_left: float | None = None


class WorkerFailed(Exception):
    """The worker has failed.

    Parameters
    ----------
    message : str
        The reason, one line.
    log : str, optional
        Last part of the worker's log.
    """

    def __init__(self, message: str, log: str = "") -> None:
        super().__init__(message)
        self.log = log


class WorkerRun:
    """One run and the folder it may write to.

    Parameters
    ----------
    title : str
        Name of the run, for display.
    steps : RunSteps
        The work.
    finish : callable
        Called with Blender's context and the output; returns the steps that import the result. They
        delete what is not needed of the folder; if closed early, they leave the scene unchanged.
    folder : Path
        The run's own folder, deleted unless the run succeeds.

    Attributes
    ----------
    title : str
        Name of the run.
    folder : Path
        The run's own folder.
    status : RunStatus
        Current status.
    longest_call_ms : float
        Longest call, in milliseconds.
    import_ms : float
        Time from the first step of `finish` to its last, in milliseconds.
    """

    def __init__(
        self,
        title: str,
        steps: RunSteps,
        finish: Callable[[Any, RunOutput], ImportSteps],
        folder: Path,
    ) -> None:
        self.title = title
        self.folder = folder
        self.status = RunStatus()
        self.longest_call_ms = 0.0
        self.import_ms = 0.0
        self._steps = steps
        self._finish = finish
        self._output: RunOutput | None = None
        self._importing: ImportSteps | None = None
        self._import_began = 0.0

    @property
    def ended(self) -> bool:
        """Whether the run is over."""
        return self.status.state in (RunState.DONE, RunState.FAILED, RunState.CANCELLED)

    def step(self) -> RunStatus:
        """Make one short step of a running run.

        Never blocks, and never raises for a failure of the work.

        Returns
        -------
        RunStatus
            The new status.
        """
        if self.status.state == RunState.RUNNING:
            began = time.perf_counter()
            self._advance()
            self.record_call(time.perf_counter() - began)
        return self.status

    def record_call(self, seconds: float) -> None:
        """Record how long a call for this run has blocked the window.

        Parameters
        ----------
        seconds : float
            Duration of the call in seconds; the longest is kept, in milliseconds.
        """
        self.longest_call_ms = max(self.longest_call_ms, 1e3 * seconds)

    def import_result(self, context: Any) -> RunStatus:
        """Import a part of the result of a ready run, in about `IMPORT_SECONDS`.

        Parameters
        ----------
        context : bpy.types.Context
            Passed on to `finish`.

        Returns
        -------
        RunStatus
            The new status; READY until the last part is imported.
        """
        if self.status.state != RunState.READY or self._output is None:
            return self.status
        began = time.perf_counter()
        with self._ended_by_errors():
            if self._importing is None:
                self._importing, self._import_began = self._finish(context, self._output), began
            try:
                next(self._importing)
                while time.perf_counter() - began < IMPORT_SECONDS:
                    next(self._importing)
            except StopIteration as stop:
                self.status = replace(self.status, notes=self._output.notes)
                self._end(RunState.DONE, stop.value)
        now = time.perf_counter()
        self.record_call(now - began)
        self.import_ms = 1e3 * (now - self._import_began)
        return self.status

    def cancel(self) -> RunStatus:
        """End the run now, its worker and its files included.

        Does nothing once the run has ended.

        Returns
        -------
        RunStatus
            The new status.
        """
        if not self.ended:
            self._end(RunState.CANCELLED, f"{self.title}: cancelled")
        return self.status

    def _advance(self) -> None:
        with self._ended_by_errors():
            try:
                update = next(self._steps)
                self.status = RunStatus(
                    RunState.RUNNING,
                    update.stage,
                    update.fraction,
                    seconds_left=update.seconds_left,
                )
            except StopIteration as stop:
                self._output = stop.value
                self.status = RunStatus(RunState.READY, "building the scene", 1.0)

    @contextlib.contextmanager
    def _ended_by_errors(self) -> Iterator[None]:
        """End the run on an error; unexpected errors also go on to Blender's console."""
        expected = False
        try:
            yield
            expected = True
        except InputError as error:
            expected = True
            self._end(RunState.FAILED, str(error))
        except MemoryError:
            expected = True
            self._end(
                RunState.FAILED,
                "there is not enough memory for the object: choose a smaller Texture Size or Size",
            )
        except WorkerFailed as failure:
            expected = True
            self._end(RunState.FAILED, str(failure), failure.log)
        finally:
            if not expected:
                self._end(
                    RunState.FAILED,
                    f"internal error of the extension, see the console: {sys.exception()}",
                )

    def _end(self, state: RunState, message: str, log: str = "") -> None:
        self._steps.close()
        if self._importing is not None:
            self._importing.close()
        self.status = replace(self.status, state=state, stage="", message=message, log=log)
        if state != RunState.DONE:
            remove_folder(self.folder)


def follow_worker(worker: WorkerProcess) -> Generator[WorkerUpdate, None, WorkerUpdate]:
    """Yield a worker's updates until it is done; end the worker when closed.

    Parameters
    ----------
    worker : WorkerProcess
        The worker.

    Returns
    -------
    WorkerUpdate
        The last update.

    Raises
    ------
    WorkerFailed
        If the worker fails or is cancelled.
    """
    try:
        while (update := worker.poll()).state == WorkerState.RUNNING:
            yield update
    finally:
        worker.kill()  # does nothing if the worker has ended
    if update.state != WorkerState.DONE:
        raise WorkerFailed(update.message, update.log)
    return update


def with_stage(stage: str, steps: Generator[None, None, Any]) -> Generator[WorkerUpdate, None, Any]:
    """Yield an update of the given stage for each step.

    Parameters
    ----------
    stage : str
        Name of the stage.
    steps : generator
        Steps that yield nothing; closed at the end.

    Returns
    -------
    Any
        The return value of `steps`.
    """
    try:
        while True:
            next(steps)
            yield WorkerUpdate(stage)
    except StopIteration as stop:
        return stop.value
    finally:
        steps.close()


def remove_folder(folder: Path) -> None:
    """Delete a run's folder.

    A worker that was killed a moment ago may still write to it, so a thread retries for some
    seconds.

    Parameters
    ----------
    folder : Path
        The folder.
    """
    shutil.rmtree(folder, ignore_errors=True)
    if folder.exists():
        threading.Thread(target=_keep_removing, args=(folder,)).start()


def _keep_removing(folder: Path) -> None:
    end = time.monotonic() + _REMOVE_SECONDS
    while folder.exists() and time.monotonic() < end:
        time.sleep(0.05)
        shutil.rmtree(folder, ignore_errors=True)
