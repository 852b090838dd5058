"""The work of each kind of run, as steps for `WorkerRun`: decompose a photo, segment a mask, add
the arrays of a result.
"""

from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path

from isc_core.result_files.diagnostics_text import status_lines
from isc_core.result_files.reading_notes_text import stored_note_lines

from ..files.image_export import export_image, export_mask
from ..files.image_source import ImageSource
from ..files.result_arrays import ARRAYS, DESCRIPTION, read_description
from ..worker.commands import (
    Box,
    DecomposeJob,
    Points,
    WorkerEnvironment,
    start_arrays,
    start_auto_mask,
    start_box_mask,
    start_decompose,
)
from ..worker.process import WorkerProcess, WorkerUpdate
from .messages import join_notes, translate_message
from .request import MethodSettings
from .worker_run import RunOutput, RunSteps, WorkerFailed, follow_worker, with_stage

_EXPORTING, _STARTING = "exporting the photo", "starting the worker"
RESULT = "result"


def decompose_steps(
    photo: ImageSource,
    mask: ImageSource | None,
    mask_size: tuple[int, int] | None,
    method: MethodSettings,
    folder: Path,
    threads: int,
    environment: WorkerEnvironment,
) -> RunSteps:
    """Decompose a photo.

    Parameters
    ----------
    photo : ImageSource
        The photo.
    mask : ImageSource or None
        The mask; None uses the photo's transparency or black background.
    mask_size : tuple of int or None
        Width and height to scale the mask to.
    method : MethodSettings
        How to decompose.
    folder : Path
        The run's folder; the result is written to `RESULT` in it.
    threads : int
        Number of threads; 0 uses one per core.
    environment : WorkerEnvironment
        What the worker runs with.

    Returns
    -------
    RunOutput
        The result folder, with arrays.
    """
    photo_path = yield from with_stage(_EXPORTING, export_image(photo, folder / "photo"))
    mask_path = None
    if mask is not None:
        mask_path = yield from with_stage(_EXPORTING, export_mask(mask, folder / "mask", mask_size))
    job = DecomposeJob(
        photo=photo_path,
        output=folder / RESULT,
        mask=mask_path,
        model=method.model,
        separator=method.separator,
        illumination=method.illumination,
        max_size=method.max_size,
        threads=threads,
        transfer=photo.transfer,
        camera=method.camera,
    )
    names = {str(photo_path): photo.name} | ({} if mask is None else {str(mask_path): mask.name})
    yield from _run_worker(lambda: start_decompose(job, environment), names)
    for exported in (photo_path, mask_path):
        # Exported copies are no longer needed; the user's own files are not in the run's folder.
        if exported is not None and exported.parent == folder:
            exported.unlink(missing_ok=True)
    notes = translate_message(result_notes(folder / RESULT), {})
    return RunOutput(folder / RESULT, notes)


def mask_steps(
    photo: ImageSource, box: Box, folder: Path, environment: WorkerEnvironment
) -> RunSteps:
    """Segment the object inside a box.

    Parameters
    ----------
    photo : ImageSource
        The photo.
    box : tuple of int
        Left, top, width and height in pixels.
    folder : Path
        The run's folder.
    environment : WorkerEnvironment
        What the worker runs with.

    Returns
    -------
    RunOutput
        The PNG file of the mask.
    """
    return (yield from _mask_steps(photo, folder, partial(_box_worker, box, environment)))


def auto_mask_steps(
    photo: ImageSource,
    points: Points,
    others: Points,
    folder: Path,
    environment: WorkerEnvironment,
) -> RunSteps:
    """Find the object by its looks.

    Parameters
    ----------
    photo : ImageSource
        The photo.
    points, others : sequence of (x, y)
        Pixels of the object and of the background; may be empty.
    folder : Path
        The run's folder.
    environment : WorkerEnvironment
        What the worker runs with.

    Returns
    -------
    RunOutput
        The PNG file of the mask.
    """
    worker = partial(_auto_worker, points, others, environment)
    return (yield from _mask_steps(photo, folder, worker))


def _box_worker(
    box: Box, environment: WorkerEnvironment, path: Path, mask: Path, transfer: str
) -> WorkerProcess:
    return start_box_mask(path, box, mask, environment, transfer)


def _auto_worker(
    points: Points,
    others: Points,
    environment: WorkerEnvironment,
    path: Path,
    mask: Path,
    transfer: str,
) -> WorkerProcess:
    return start_auto_mask(path, points, others, mask, environment, transfer)


def _mask_steps(
    photo: ImageSource, folder: Path, worker: Callable[[Path, Path, str], WorkerProcess]
) -> RunSteps:
    path = yield from with_stage(_EXPORTING, export_image(photo, folder / "photo"))
    mask = folder / "mask.png"
    yield from _run_worker(lambda: worker(path, mask, photo.transfer), {str(path): photo.name})
    return RunOutput(mask)


def arrays_steps(result: Path, environment: WorkerEnvironment) -> RunSteps:
    """Add the arrays that Blender reads to a result folder without them.

    Parameters
    ----------
    result : Path
        Result folder.
    environment : WorkerEnvironment
        What the worker runs with.

    Returns
    -------
    RunOutput
        The result folder.
    """
    if not (result / ARRAYS).is_file():
        yield from _run_worker(lambda: start_arrays(result, environment), {})
    return RunOutput(result)


def result_notes(result: Path) -> str:
    """Return the notes on a result in one line, "" if there are none.

    Parameters
    ----------
    result : Path
        Result folder.

    Returns
    -------
    str
        For example why the solver stopped early, or which assumptions do not hold.

    Raises
    ------
    InputError
        If the folder is no result.
    """
    description = read_description(result / DESCRIPTION)
    source = description.get("input")
    stored = source.get("reading_notes") if isinstance(source, dict) else None
    return join_notes([*stored_note_lines(stored), *status_lines(description.get("status", {}))])


def _run_worker(
    start: Callable[[], WorkerProcess], names: Mapping[str, str]
) -> Generator[WorkerUpdate, None, WorkerUpdate]:
    """Start a worker and follow it; `names` are those of images by path, for its messages."""
    worker = yield from _start_in_thread(start)
    try:
        return (yield from follow_worker(worker))
    except WorkerFailed as failure:
        raise WorkerFailed(translate_message(str(failure), names), failure.log) from failure


def _start_in_thread(
    start: Callable[[], WorkerProcess],
) -> Generator[WorkerUpdate, None, WorkerProcess]:
    """On a busy machine, starting a process of a large program may block the window too long."""
    pool = ThreadPoolExecutor(1)
    starting = pool.submit(start)
    pool.shutdown(wait=False)
    returned = False
    try:
        yield WorkerUpdate(_STARTING)
        while not starting.done():
            yield WorkerUpdate(_STARTING)
        returned = True
        return starting.result()
    finally:
        if not returned:  # cancelled in the meantime
            starting.add_done_callback(_kill_started)


def _kill_started(started: Future[WorkerProcess]) -> None:
    if started.exception() is None:
        started.result().kill()
