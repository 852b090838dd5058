"""The process that does the work, seen from Blender: started, followed, cancelled; no call here
ever waits for it.

Problem: a decomposition takes from seconds to minutes, needs packages that Blender's process must
not load, and may crash; Blender's window has to go on. `python -m isc_core ... --progress json`
runs in a process of its own, with an environment that names everything it needs; a thread reads its
lines, and `Worker.poll` returns what the last one said.

However it ends, nothing of it is left but a result that is complete: asked to cancel, the worker
tidies up itself; killed, its traces are removed here; and when Blender dies, the end of its
standard input tells the worker to stop.

Citation: process groups, IEEE Std 1003.1-2017, setsid and kill.

Limits: on Windows a kill reaches the worker's own children only while it lives.
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
from pathlib import Path
from typing import IO, Any

from isc_core.atomic import remove_unfinished, unfinished
from isc_core.errors import InputError

Box = tuple[int, int, int, int]

_PATIENCE_SECONDS = 2.0  # from the wish to cancel to the kill
_TIDYING_SECONDS = (
    5.0  # how long Blender's own end waits for the traces of a killed worker to be removed
)
_NICENESS = 5  # the window comes first where both want the processor
_REPORT_BYTES = 8000
_KEPT = (
    "PATH",
    "HOME",
    "USER",
    "LOGNAME",
    "LANG",
    "LC_ALL",
    "LC_CTYPE",
    "TMPDIR",
    "TEMP",
    "TMP",
    "SYSTEMROOT",
    "SYSTEMDRIVE",
    "WINDIR",
    "COMSPEC",
    "PATHEXT",
    "USERPROFILE",
    "APPDATA",
    "LOCALAPPDATA",
    "PROGRAMDATA",
    "NUMBER_OF_PROCESSORS",
    "PROCESSOR_ARCHITECTURE",
    "PROCESSOR_IDENTIFIER",
)


@dataclass(frozen=True)
class Job:
    """What `isc decompose` is asked for; see its help.

    `photo`, `mask`: image files or NumPy arrays (`.npy`). `output`: the result's folder; an earlier
    result there is replaced. `model`, `separator`, `illumination`, `transfer`: names it knows.
    `max_size`: the object's long side in pixels, 0 the photo's. `threads`: 0 for one each core.
    """

    photo: Path
    output: Path
    mask: Path | None
    model: str
    separator: str
    illumination: str
    max_size: int
    threads: int = 0
    transfer: str = "auto"


@dataclass(frozen=True)
class WorkerEnvironment:
    """What a worker is run with. `python`: the interpreter. `search`: folders where it finds
    `isc_core` and the packages that this needs. `cache`: the folder where compiled code is kept
    between runs; made if it lacks.
    """

    python: Path
    search: tuple[Path, ...]
    cache: Path

    def variables(self, threads: int = 0) -> dict[str, str]:
        """The worker's whole environment; of Blender's own only what any program needs."""
        own = {
            "PYTHONPATH": os.pathsep.join(map(str, self.search)),
            "PYTHONNOUSERSITE": "1",
            "PYTHONSAFEPATH": "1",
            "PYTHONUTF8": "1",
            "PYTHONPYCACHEPREFIX": str(self.cache / "bytecode"),
            "NUMBA_CACHE_DIR": str(self.cache),
        }
        limits = {
            name: str(threads)
            for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
            if threads > 0
        }
        return {name: os.environ[name] for name in _KEPT if name in os.environ} | own | limits


@dataclass(frozen=True)
class Update:
    """How far the work is. `stage`: for people. `fraction`: of all of it, in [0, 1]. `state`:
    "running", "done", "failed" or "cancelled". `message`: when done, the lines that the command
    would print; when failed, one line that says why. `report`: the tail of the worker's log once it
    has ended.
    """

    stage: str = ""
    fraction: float = 0.0
    state: str = "running"
    message: str = ""
    report: str = ""


class Worker:
    """A process at work, made by `start` and its sisters.

    All methods return at once and may be called at any time.
    """

    def __init__(self, command: Sequence[str], output: Path, variables: Mapping[str, str]) -> None:
        """Runs `command`, which writes `output`. Raises `OSError` where it cannot be run."""
        self._output = output
        self._spared = unfinished(output)
        self._made = [parent for parent in output.parents if not parent.exists()]
        self._update = Update("starting")
        self._stopped = False
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
                **_apart(),
            )
            stack.pop_all()
        _lower_priority(self._process)
        threading.Thread(target=self._follow, name="isc-worker", daemon=True).start()

    def poll(self) -> Update:
        """What is known now."""
        return self._update

    def cancel(self) -> None:
        """Asks the worker to stop; it is killed if it has not done so after two seconds.

        Without effect once it has ended.
        """
        if not self._ended.is_set():
            self._stopped = True
            with contextlib.suppress(OSError, ValueError):  # it has just ended
                assert self._process.stdin is not None
                self._process.stdin.close()
            self._see_to_the_end(_PATIENCE_SECONDS)

    def kill(self) -> None:
        """Ends the worker now. Without effect once it has ended."""
        if not self._ended.is_set():
            self._stopped = True
            self._see_to_the_end(0.0)

    def _see_to_the_end(self, patience: float) -> None:
        """A thread that Blender's own end waits for, so that nothing is left behind then either."""
        threading.Thread(
            target=self._end, args=(patience,), name="isc-worker-end", daemon=False
        ).start()

    def _end(self, patience: float) -> None:
        if not self._ended.wait(patience):
            _kill_group(self._process)
            self._ended.wait(_TIDYING_SECONDS)

    def _follow(self) -> None:
        """In a thread of its own, to the worker's end."""
        last: dict[str, Any] = {}
        with self._process as process:
            assert process.stdout is not None
            for line in process.stdout:
                event = _event(line)
                if event.get("event") == "progress":
                    self._update = Update(
                        str(event.get("stage", "")), float(event.get("fraction", 0.0))
                    )
                elif event:
                    last = event
        final = self._outcome(last, process.returncode)
        if final.state != "done":
            self._tidy_up()
        self._update = final
        self._ended.set()

    def _outcome(self, last: Mapping[str, Any], code: int) -> Update:
        fraction, report = self._update.fraction, _tail(self._log)
        match last.get("event"):
            case "done":
                return Update("done", 1.0, "done", "\n".join(last.get("lines", ())), report)
            case "failed":
                return Update("failed", fraction, "failed", str(last.get("message", "")), report)
        if last.get("event") == "cancelled" or self._stopped:
            return Update("cancelled", fraction, "cancelled", "cancelled", report)
        return Update("failed", fraction, "failed", _how_it_died(code, report), report)

    def _tidy_up(self) -> None:
        """Removes what a killed worker could not."""
        with contextlib.suppress(OSError):
            remove_unfinished(self._output, self._spared)
        for (
            parent
        ) in self._made:  # the innermost first; one that somebody else has filled meanwhile stays
            with contextlib.suppress(OSError):
                parent.rmdir()


def start(job: Job, environment: WorkerEnvironment) -> Worker:
    """Decomposes a photo into a result folder with arrays.

    Raises `InputError` where the worker cannot be started.
    """
    words = ["decompose", _full(job.photo), "--arrays", "-o", _full(job.output)]
    for name in ("model", "separator", "illumination", "max_size", "threads", "transfer"):
        words += [f"--{name.replace('_', '-')}", str(getattr(job, name))]
    if job.mask is not None:
        words += ["--mask", _full(job.mask)]
    return _begin(words, job.output, environment, job.threads)


def start_edit(result: Path, arguments: Sequence[str], environment: WorkerEnvironment) -> Worker:
    """Edits a result. `arguments`: those of `isc edit` after RESULT: the action, its options and
    `-o DIR` with a full path.

    Raises `InputError` where the worker cannot be started, or `-o` lacks.
    """
    if "-o" not in arguments[:-1]:
        raise InputError("an edit needs a folder to write to: give -o DIR")
    output = Path(arguments[arguments.index("-o") + 1])
    return _begin(["edit", _full(result), *arguments], output, environment)


def start_arrays(result: Path, environment: WorkerEnvironment) -> Worker:
    """Adds `arrays.npz` to a result folder without it.

    Raises `InputError` where the worker cannot be started.
    """
    return _begin(["arrays", _full(result)], result / "arrays.npz", environment)


def box_mask(
    photo: Path, box: Box, output: Path, environment: WorkerEnvironment, transfer: str = "auto"
) -> Worker:
    """Cuts the object inside `box` (left, top, width, height in pixels) out of a photo; `output`:
    the mask, a PNG.

    Raises `InputError` where the worker cannot be started.
    """
    numbers = ",".join(map(str, box))
    # The equals sign keeps a negative number from being read as an option.
    return _begin(
        ["mask", _full(photo), f"--box={numbers}", "--transfer", transfer, "-o", _full(output)],
        output,
        environment,
    )


def _begin(
    words: Sequence[str], output: Path, environment: WorkerEnvironment, threads: int = 0
) -> Worker:
    with contextlib.suppress(OSError):  # without it the worker compiles anew each time
        environment.cache.mkdir(parents=True, exist_ok=True)
    command = [str(environment.python), "-m", "isc_core", *words, "--progress", "json"]
    try:
        return Worker(command, Path(_full(output)), environment.variables(threads))
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"the worker cannot be started with {environment.python} ({reason}): install the extension again"
        ) from error


def _full(path: Path) -> str:
    """The worker's current folder is not Blender's."""
    return os.path.abspath(path)


def _apart() -> dict[str, Any]:
    """A process group of its own, no console window, and on Windows already the lower priority."""
    if sys.platform == "win32":
        return {
            "creationflags": subprocess.CREATE_NO_WINDOW
            | subprocess.CREATE_NEW_PROCESS_GROUP
            | subprocess.BELOW_NORMAL_PRIORITY_CLASS
        }
    return {"start_new_session": True}


def _lower_priority(process: "subprocess.Popen[str]") -> None:
    if sys.platform != "win32":
        with contextlib.suppress(OSError):  # it has ended already, and `poll` will say why
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


def _event(line: str) -> dict[str, Any]:
    """The event in a line; nothing where a library has printed something."""
    try:
        event = json.loads(line)
    except ValueError:
        return {}
    return event if isinstance(event, dict) else {}


def _tail(log: IO[bytes]) -> str:
    """The last lines of a log that nobody writes to any more; closes it."""
    with log:
        length = log.seek(0, os.SEEK_END)
        log.seek(max(0, length - _REPORT_BYTES))
        return log.read().decode("utf-8", "replace").strip()


def _how_it_died(code: int, report: str) -> str:
    if code < 0:
        name = next((known.name for known in signal.Signals if known == -code), str(-code))
        return f"the worker was killed ({name}): if memory ran out, a smaller size helps; else try again"
    said = report.splitlines()[-1] if report else "it left no message"
    return f"the worker ended unexpectedly (exit code {code}): {said}"
