"""What the tests have workers do instead of decomposing.

In a module of its own, so that worker processes can import it.
"""

import os
import signal
import time
from pathlib import Path

from isc_core.batch.item import DONE, ImageJob, Outcomes
from isc_core.batch.work import process
from isc_core.progress import Monitor


def obey(job: ImageJob, monitor: Monitor) -> str:
    """Does what the image's name says: hangs without looking at anything, polls for ever, kills its
    worker, raises; else writes a file.
    """
    name = Path(job.image).stem
    if name == "hang":
        time.sleep(600)
    while name == "poll":
        monitor.report("polling", 0.5)
        time.sleep(0.01)
    if name == "kill" or (name == "kill_once" and _first_time(job)):
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "fault":
        raise ZeroDivisionError("a fault\nof two lines")
    if name == "full":
        raise MemoryError
    job.folder.mkdir(
        parents=True, exist_ok=True
    )  # done before, by a worker that was lost before it could tell
    (job.folder / "made").write_text(job.image)
    return DONE


def _first_time(job: ImageJob) -> bool:
    mark = job.plan.output / ".isc-batch" / "once"
    first = not mark.exists()
    mark.touch()
    return first


def obedient(job: ImageJob) -> Outcomes:
    """The task of a run whose images say what happens."""
    return process(job, obey)
