"""A worker process: started, polled and cancelled without ever blocking the caller.

Problem: a decomposition takes from seconds to minutes, needs packages that Blender's process must
not load, and may crash, while Blender's window has to stay responsive. `python -m isc_core ...
--progress json` therefore runs in its own process with an explicit environment. A thread reads its
output, and `WorkerProcess.poll` returns the latest state.

However the worker ends, it leaves only a complete result or nothing. When cancelled, it cleans up
itself. When killed, its unfinished files are removed here. When Blender dies, the end of its
standard input makes the worker stop.

Citation: process groups, IEEE Std 1003.1-2017, setsid and kill.

Limits: on Windows a kill reaches the worker's own child processes only while the worker is alive.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import IO, Any

from isc_core.io.atomic import remove_unfinished, remove_unfinished_in, unfinished

_CANCEL_SECONDS = 2.0  # from the request to cancel to the kill
# How long Blender's own exit waits for the files of a killed worker to be removed.
_CLEANUP_SECONDS = 5.0
_NICENESS = 10  # the window takes precedence where both need the processor
_LOG_BYTES = 8000


class WorkerState(StrEnum):
    """What a worker is doing."""

    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


@dataclass(frozen=True)
class WorkerUpdate:
    """Progress and state of a worker.

    Attributes
    ----------
    stage : str
        Name of the current stage, for display.
    fraction : float
        Share of the whole job that is done, in [0, 1].
    state : WorkerState
        What the worker is doing.
    message : str
        When done, the lines the command would print. When failed, one line with the reason.
    log : str
        Last part of the worker's standard error, once it has ended.
    seconds_left : float or None
        Estimate of the time until the end; None if unknown.
    part : (int, int) or None
        Number of the present object, from 1, and number of objects; None for a single one.
    """

    stage: str = ""
    fraction: float = 0.0
    state: WorkerState = WorkerState.RUNNING
    message: str = ""
    log: str = ""
    seconds_left: float | None = None
    part: tuple[int, int] | None = None


class WorkerProcess:
    """A running worker.

    All methods return at once and may be called at any time.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    output : Path
        File or folder that the command writes.
    variables : mapping of str to str
        The complete environment of the process.

    Raises
    ------
    OSError
        If the command cannot be run.
    """

    def __init__(self, command: Sequence[str], output: Path, variables: Mapping[str, str]) -> None:
        self._output = output
        # Results of several objects lie in the output, each with unfinished files beside it.
        self._present = unfinished(output) | frozenset(output.resolve().glob(".*"))
        self._created = [parent for parent in output.parents if not parent.exists()]
        self._update = WorkerUpdate("starting")
        self._cancelled = False
        self._ended = threading.Event()
        with contextlib.ExitStack() as stack:
            self._log: IO[bytes] = stack.enter_context(tempfile.TemporaryFile())
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._log,
                cwd=tempfile.gettempdir(),
                env=dict(variables),
                encoding="utf-8",
                errors="replace",
                **_detached(),
            )
            stack.pop_all()
        _lower_priority(self._process)
        threading.Thread(target=self._follow, name="isc-worker", daemon=True).start()

    @property
    def pid(self) -> int:
        """Process identifier."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code, negative for a signal; None while the process runs."""
        return self._process.poll()

    def poll(self) -> WorkerUpdate:
        """Return the latest update."""
        return self._update

    def cancel(self) -> None:
        """Ask the worker to stop, and kill it if it has not stopped after two seconds.

        Does nothing once the worker has ended.
        """
        if not self._ended.is_set():
            self._cancelled = True
            with contextlib.suppress(OSError, ValueError):  # it has just ended
                assert self._process.stdin is not None
                self._process.stdin.close()
            self._end_in_thread(_CANCEL_SECONDS)

    def kill(self) -> None:
        """End the worker now. Does nothing once the worker has ended."""
        if not self._ended.is_set():
            self._cancelled = True
            self._end_in_thread(0.0)

    def _end_in_thread(self, patience: float) -> None:
        """Not a daemon thread: Blender's exit waits for it, so that the files are removed."""
        if not threading.main_thread().is_alive():
            # Python is exiting, and waits for no thread that starts now (in 3.12, none can).
            self._end(patience)
            return
        threading.Thread(
            target=self._end, args=(patience,), name="isc-worker-end", daemon=False
        ).start()

    def _end(self, patience: float) -> None:
        if not self._ended.wait(patience):
            _kill_group(self._process)
            self._ended.wait(_CLEANUP_SECONDS)

    def _follow(self) -> None:
        """Read the worker's output to its end, in a thread."""
        last: dict[str, Any] = {}
        with self._process as process:
            assert process.stdout is not None
            for line in process.stdout:
                event = _parse_event(line)
                if event.get("event") == "progress":
                    self._update = _progress(event)
                elif event:
                    last = event
        final = self._final_update(last, process.returncode)
        if final.state != WorkerState.DONE:
            self._clean_up()
        self._update = final
        self._ended.set()

    def _final_update(self, last: Mapping[str, Any], code: int) -> WorkerUpdate:
        fraction, log = self._update.fraction, _read_tail(self._log)
        event = last.get("event")
        if event == "done":
            lines = "\n".join(last.get("lines", ()))
            return WorkerUpdate("done", 1.0, WorkerState.DONE, lines, log)
        if event == "failed":
            message = str(last.get("message", ""))
            return WorkerUpdate("failed", fraction, WorkerState.FAILED, message, log)
        if event == "cancelled" or self._cancelled:
            return WorkerUpdate("cancelled", fraction, WorkerState.CANCELLED, "cancelled", log)
        return WorkerUpdate("failed", fraction, WorkerState.FAILED, _crash_message(code, log), log)

    def _clean_up(self) -> None:
        """Remove what a killed worker could not."""
        with contextlib.suppress(OSError):
            remove_unfinished(self._output, self._present)
            remove_unfinished_in(self._output, self._present)
        # Innermost folder first; one that another program has filled meanwhile stays.
        for parent in self._created:
            with contextlib.suppress(OSError):
                parent.rmdir()


def _detached() -> dict[str, Any]:
    """Options for a new process group without a console; on Windows also the lower priority."""
    if sys.platform == "win32":
        return {
            "creationflags": subprocess.CREATE_NO_WINDOW
            | subprocess.CREATE_NEW_PROCESS_GROUP
            | subprocess.BELOW_NORMAL_PRIORITY_CLASS
        }
    return {"start_new_session": True}


def _lower_priority(process: "subprocess.Popen[str]") -> None:
    if sys.platform != "win32":
        with contextlib.suppress(OSError):  # it has ended already; `poll` will return the reason
            os.setpriority(
                os.PRIO_PROCESS, process.pid, os.getpriority(os.PRIO_PROCESS, 0) + _NICENESS
            )


def _kill_group(process: "subprocess.Popen[str]") -> None:
    if process.poll() is not None:
        return
    with contextlib.suppress(OSError):  # it has just ended
        if sys.platform == "win32":
            tree = ["taskkill", "/F", "/T", "/PID", str(process.pid)]
            subprocess.run(
                tree, capture_output=True, check=False, creationflags=subprocess.CREATE_NO_WINDOW
            )
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)


def _parse_event(line: str) -> dict[str, Any]:
    """The event in a line; empty for text that a library has printed."""
    try:
        event = json.loads(line)
    except ValueError:
        return {}
    return event if isinstance(event, dict) else {}


def _progress(event: Mapping[str, Any]) -> WorkerUpdate:
    part = event.get("part")
    return WorkerUpdate(
        str(event.get("stage", "")),
        float(event.get("fraction", 0.0)),
        part=None if part is None else (int(part[0]), int(part[1])),
    )


def _read_tail(log: IO[bytes]) -> str:
    """The end of a finished log; closes the file."""
    with log:
        length = log.seek(0, os.SEEK_END)
        log.seek(max(0, length - _LOG_BYTES))
        return log.read().decode("utf-8", "replace").strip()


def _crash_message(code: int, log: str) -> str:
    if code < 0:
        name = next((known.name for known in signal.Signals if known == -code), str(-code))
        return (
            f"the worker was killed ({name}): choose a smaller size if memory ran out, "
            "otherwise try again"
        )
    reason = log.splitlines()[-1] if log else "no error message"
    return f"the worker ended unexpectedly (exit code {code}): {reason}"
