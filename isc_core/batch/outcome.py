"""One attempt at a result: its time, its peak memory, and its outcome.

A problem of the image is an outcome; a bug of the program raises.

Limits: the peak is that of the process, and only Linux reports it.
"""

import contextlib
import gc
import time
from collections.abc import Callable
from pathlib import Path

from .. import __version__
from ..errors import Cancelled, InputError
from ..io.memory import memory_message
from ..progress import Monitor
from .attempts import attempt
from .item import FAILED, ImageJob, ImageOutcome
from .run_folder import RunFolder

_CHECK_SECONDS = 2.0

Work = Callable[[ImageJob, Monitor], str]


def outcome_of(job: ImageJob, work: Work) -> ImageOutcome:
    """Do the work of a job, and return its outcome.

    Parameters
    ----------
    job : ImageJob
    work : callable
        Returns the status.

    Returns
    -------
    ImageOutcome
    """
    start = time.perf_counter()
    _reset_peak()
    status, reason = _status_of(job, work)
    # Meshes have reference cycles: without this they are kept for a hundred images, 3 MB each.
    gc.collect(1)
    return ImageOutcome(status, reason, round(time.perf_counter() - start, 4), _peak_mb())


def _status_of(job: ImageJob, work: Work) -> tuple[str, str]:
    plan = job.plan
    try:
        if plan.version != __version__:
            raise InputError(
                f"this worker has ISC {__version__}, the run {plan.version}: install the same "
                "version everywhere"
            )
        folder = RunFolder(plan.output)
        folder.require_run(plan.run)
        with attempt(folder.attempt(job.name), plan.run, plan.timeout) as monitor:
            return work(job, _cancelled_with_run(monitor, folder, plan.run)), ""
    except Cancelled as stopped:
        return FAILED, f"exceeded --timeout {plan.timeout:g} s, in the stage: {stopped}"
    except InputError as error:
        return FAILED, str(error)
    except MemoryError as error:
        remedy = "use a smaller image, a smaller --max-size or fewer workers"
        return FAILED, memory_message(error, remedy)
    except OSError as error:
        return FAILED, f"{error.filename or job.image}: {error.strerror or error}"


def _cancelled_with_run(monitor: Monitor, folder: RunFolder, run: str) -> Monitor:
    """A monitor that also cancels when the run has ended: a cluster's workers go on otherwise."""
    checked, expected = time.monotonic(), True

    def cancelled() -> bool:
        nonlocal checked, expected
        if (now := time.monotonic()) - checked > _CHECK_SECONDS:
            checked, expected = now, folder.runs(run)
        return not expected or monitor.cancelled()

    return Monitor(cancelled=cancelled)


def _reset_peak() -> None:
    """Reset the peak memory of the process (Linux only; elsewhere without effect)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak_mb() -> float:
    """Peak memory since the reset, in MB; 0 if the system does not report it."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return round(int(line.split()[1]) / 1024, 1)
    return 0.0
