"""The job of one image, as a worker runs it.

A worker does one image at a time, however many threads it has: the watchdog and the peak of memory
belong to the process.
"""

import contextlib
import gc
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path, PurePath

from .. import __version__
from ..decomposition.pipeline import decompose
from ..errors import Cancelled, InputError
from ..io.memory import memory_message
from ..masking.finder import MaskSearch
from ..photo import read_photo
from ..progress import Monitor
from ..result_files.contact_sheet import thumbnail
from ..result_files.result_folder import require_room, save
from ..sirfs.priors.prior_file import load_prior_set
from ..sirfs.priors.prior_set import PriorSet
from .attempts import attempt
from .fetch import is_url, local_copy, sha256
from .fingerprint import fingerprint, is_finished
from .item import DONE, FAILED, SKIPPED, ImageJob, ImageOutcome
from .run_folder import RunFolder

_CHECK_SECONDS = 2.0
_process_lock = threading.Lock()

Work = Callable[[ImageJob, Monitor], str]


def process(job: ImageJob, work: "Work | None" = None) -> ImageOutcome:
    """Decompose the job's image unless its result exists.

    A problem of the image is an outcome; a bug of the program raises.

    Parameters
    ----------
    job : ImageJob
    work : callable, optional
        What to do; `decompose_into` by default. Returns the status.

    Returns
    -------
    ImageOutcome
    """
    with _process_lock:
        start = time.perf_counter()
        _reset_peak()
        status, reason = _run(job, work or decompose_into)
        # Meshes have reference cycles: without this they stay for a hundred images, 3 MB each.
        gc.collect(1)
        return ImageOutcome(status, reason, round(time.perf_counter() - start, 4), _peak_mb())


def _run(job: ImageJob, work: Work) -> tuple[str, str]:
    plan = job.plan
    try:
        if plan.version != __version__:
            raise InputError(
                f"this worker has ISC {__version__}, the run {plan.version}: install the same "
                "version everywhere"
            )
        folder = RunFolder(plan.output)
        folder.require_run(plan.run)
        with attempt(folder.attempts / job.name, plan.run, plan.timeout) as monitor:
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
    """Cancel also when the run has ended: on a cluster, nothing else stops its workers."""
    checked, expected = time.monotonic(), True

    def cancelled() -> bool:
        nonlocal checked, expected
        if (now := time.monotonic()) - checked > _CHECK_SECONDS:
            checked, expected = now, folder.runs(run)
        return not expected or monitor.cancelled()

    return Monitor(cancelled=cancelled)


def decompose_into(job: ImageJob, monitor: Monitor) -> str:
    """Decompose the image into its folder, as `isc decompose` does.

    Parameters
    ----------
    job : ImageJob
    monitor : Monitor

    Returns
    -------
    str
        "done" or "skipped".
    """
    plan, fetched = job.plan, RunFolder(job.plan.output).fetched
    with contextlib.ExitStack() as stack:
        photo = stack.enter_context(local_copy(job.image, plan.limits, fetched))
        mask = stack.enter_context(local_copy(job.mask, plan.limits, fetched)) if job.mask else None
        sums = sha256(photo), "" if mask is None else sha256(mask)
        expected = fingerprint(job, *sums)
        if is_finished(job.folder, expected, plan.arrays):
            _draw_thumbnail(job, redraw=False)
            return SKIPPED
        monitor.report("reading", 0.0)
        try:
            _decompose(job, photo, mask, sums, expected, monitor)
        except InputError as error:
            # Replace the name of the temporary copy by the location.
            raise InputError(
                _renamed(str(error), ((photo, job.image), (mask, job.mask)))
            ) from error
    _draw_thumbnail(job, redraw=True)
    return DONE


def _decompose(
    job: ImageJob,
    path: Path,
    mask: Path | None,
    sums: tuple[str, str],
    expected: str,
    monitor: Monitor,
) -> None:
    plan, recipe = job.plan, job.recipe
    photo = read_photo(path, mask, recipe.transfer, limits=plan.limits, finder=MaskSearch())
    if photo.original.sha256 != sums[0] or (mask is not None and sha256(mask) != sums[1]):
        raise InputError(f"{job.image} changed while it was read: run again when it is complete")
    require_room(job.folder, 0, arrays=plan.arrays)
    priors = _priors(plan.priors, plan.priors_sha256) if plan.priors else None
    name = PurePath(job.image).name
    result = decompose(
        photo, recipe.settings, prior_set=priors, name=name, monitor=monitor.part(0.0, 0.8)
    )
    source = {**result.provenance.input, "mask_sha256": sums[1] or None, "fingerprint": expected}
    result = replace(result, provenance=replace(result.provenance, input=source))
    writing = monitor.part(0.8, 1.0)
    save(result, job.folder, arrays=plan.arrays, cover=photo.cover, monitor=writing)


def _renamed(message: str, copies: tuple[tuple[Path | None, str], ...]) -> str:
    for copy, location in copies:
        if copy is not None and is_url(location):
            message = message.replace(str(copy), location)
    return message


@lru_cache(maxsize=2)
def _priors(path: str, expected: str) -> PriorSet:
    if sha256(Path(path)) != expected:
        raise InputError(
            f"{path} changed after the run was started: all workers must read the same priors"
        )
    return load_prior_set(Path(path))


def _draw_thumbnail(job: ImageJob, *, redraw: bool) -> None:
    """Draw the thumbnail, in a folder of its own."""
    target = RunFolder(job.plan.output).thumbnail(job.name)
    if redraw or not target.is_file():
        thumbnail(job.folder / "preview.png", target)


# --- peak memory ----------------------------------------------------------------------------------


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
