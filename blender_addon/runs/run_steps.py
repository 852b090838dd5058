"""The work of each kind of run as steps for `WorkerRun`: decompose a photo, find a mask, read a
result.
"""

import shutil
import time
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import astuple, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from isc_core.errors import InputError
from isc_core.refinement.gloss_note import gloss_line
from isc_core.result_files.diagnostics_text import status_lines
from isc_core.result_files.object_folders import object_folders
from isc_core.result_files.reading_notes_text import stored_note_lines

from ..files.image_export import export_image, export_mask
from ..files.image_source import ImageSource
from ..files.result_arrays import ARRAYS, DESCRIPTION, ResultArrays, read_description, read_result
from ..files.result_cache import ResultCache, content_key
from ..scene.objects import prepare_objects
from ..scene.preparation import BuildOptions, PreparedObject, prepare
from ..settings.usage import SEPARATING_MODELS, SIRFS_MODELS
from ..worker.commands import (
    CERTAIN,
    Box,
    DecomposeJob,
    Points,
    WorkerEnvironment,
    start_arrays,
    start_auto_mask,
    start_box_mask,
    start_decompose,
)
from ..worker.pace import Pace
from ..worker.process import WorkerProcess, WorkerUpdate
from .messages import NOTE, notes_of_objects, translate_message
from .request import MethodSettings, parse_points
from .worker_run import RunOutput, RunSteps, WorkerFailed, follow_worker, with_stage

_EXPORTING = "exporting the photo"
_STARTING = WorkerUpdate("starting the worker")
_LOOKING = WorkerUpdate("looking for an earlier result")
_READING = WorkerUpdate("reading the result", 1.0)
RESULT = "result"
T = TypeVar("T")


@dataclass(frozen=True)
class ResultDestination:
    """Where the result of a run goes.

    Attributes
    ----------
    folder : Path
        The run's own folder; the result is written to `RESULT` in it, unless it is cached.
    cache : ResultCache or None
        Earlier results, to which this one is added; None to use none.
    keep : bool
        Whether a copy of a cached result is kept in the run's folder, without the arrays.
    build : BuildOptions
        What will be built from it.
    with_photo : bool
        Whether the masked photo of the result becomes an image.
    """

    folder: Path
    cache: ResultCache | None = None
    keep: bool = False
    build: BuildOptions = field(default_factory=BuildOptions)
    with_photo: bool = False


def decompose_steps(
    photo: ImageSource,
    mask: ImageSource | None,
    mask_size: tuple[int, int] | None,
    method: MethodSettings,
    place: ResultDestination,
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
    place : ResultDestination
        Where the result goes.
    threads : int
        Number of threads; 0 uses one per core.
    environment : WorkerEnvironment
        What the worker runs with.

    Returns
    -------
    RunOutput
        The result folder, and what is built from it.
    """
    folder = place.folder
    highlights, not_highlights = (
        tuple(parse_points(text)) if method.model == "joint" else ()
        for text in (method.highlights, method.not_highlights)
    )
    photo_path = yield from with_stage(_EXPORTING, export_image(photo, folder / "photo"))
    mask_path = None
    if mask is not None:
        mask_path = yield from with_stage(_EXPORTING, export_mask(mask, folder / "mask", mask_size))
    job = DecomposeJob(
        photo=photo_path,
        output=folder / RESULT,
        mask=mask_path,
        model=method.model,
        separator=method.separator if method.model in SEPARATING_MODELS else "isc",
        illumination=method.illumination,
        max_size=method.max_size,
        threads=threads,
        transfer=photo.transfer,
        camera=method.camera,
        texture_size=method.texture_size,
        highlight_odds=method.highlight_odds if method.model == "joint" else CERTAIN,
        highlights=highlights,
        not_highlights=not_highlights,
        each=place.build.each,
        refine=method.refine,
        light_colour=method.light_colour if method.model in SIRFS_MODELS else "balanced",
        cache=None if place.cache is None else place.cache.folder,
    )
    names = {str(photo_path): photo.name} | ({} if mask is None else {str(mask_path): mask.name})
    if job.each:
        output = yield from _several_objects(job, place, names, environment)
    else:
        prepared = yield from _cached_result(job, place, names, environment)
        result = prepared.result.folder
        output = RunOutput(result, _notes(result), (prepared,), _remark(result))
    for exported in (photo_path, mask_path):
        # Exported copies are no longer needed; the user's own files are not in the run's folder.
        if exported is not None and exported.parent == folder:
            exported.unlink(missing_ok=True)
    return output


def _several_objects(
    job: DecomposeJob,
    place: ResultDestination,
    names: Mapping[str, str],
    environment: WorkerEnvironment,
) -> RunSteps:
    """What is built from each object: from cached results of the same content, or from a worker's.

    Objects that fail are listed in the notes; the next run tries all of them again.
    """
    cache, key, folder = place.cache, "", job.output
    failures: tuple[str, ...] = ()
    if cache is not None:
        key = yield from _in_thread(partial(_job_key, job, environment), _LOOKING)
    if cache is None or not key or not cache.place(key).is_dir():
        worker = _run_worker(lambda: start_decompose(job, environment), names)
        try:
            yield from _with_time_left(worker, Pace(job.max_size, job.refine, several=True))
        except WorkerFailed as failure:
            if not object_folders(folder):
                raise
            failures, cache = (f"{NOTE}{failure}",), None
        if cache is not None and key:
            yield from _in_thread(partial(cache.store, key, folder), _READING)
    if cache is not None and key:
        folder = cache.place(key)
    made = partial(read_and_prepare, folder, place.build, with_photo=place.with_photo)
    try:
        prepared = yield from _in_thread(made, _READING)
    except InputError:
        if cache is not None and key:  # or it would be found again
            shutil.rmtree(folder, ignore_errors=True)
        raise
    if cache is not None and key:
        yield from _in_thread(partial(cache.trim, key), _READING)
        if place.keep:
            yield from _in_thread(partial(_copy_result, folder, job.output), _READING)
            folder = job.output
            prepared = tuple(_in_folder(one, folder) for one in prepared)
    results = object_folders(folder)
    notes = notes_of_objects({one.name: _notes(one) for one in results})
    remarks = set(map(_remark, results))
    return RunOutput(
        folder,
        (*failures, *notes),
        prepared,
        remarks.pop() if len(remarks) == 1 else "",
    )


def _in_folder(prepared: PreparedObject, folder: Path) -> PreparedObject:
    result = prepared.result
    return replace(prepared, result=replace(result, folder=folder / result.folder.name))


def _cached_result(
    job: DecomposeJob,
    place: ResultDestination,
    names: Mapping[str, str],
    environment: WorkerEnvironment,
) -> Generator[WorkerUpdate, None, PreparedObject]:
    """What is built from a job's result: a cached one of the same content, or a worker's."""
    cache, key = place.cache, ""
    result: ResultArrays | None = None
    if cache is not None:
        key = yield from _in_thread(partial(_job_key, job, environment), _LOOKING)
    if cache is not None and key:
        job = replace(job, output=cache.place(key))
        result = yield from _in_thread(partial(cache.read, key), _LOOKING)
    if result is None:
        worker = _run_worker(lambda: start_decompose(job, environment), names)
        yield from _with_time_left(worker, Pace(job.max_size, job.refine))
        result = yield from _in_thread(partial(read_result, job.output), _READING)
    prepared = yield from _in_thread(
        partial(prepare, result, place.build, with_photo=place.with_photo), _READING
    )
    if cache is not None and key:
        yield from _in_thread(partial(cache.trim, key), _READING)
        if place.keep:
            kept = place.folder / RESULT
            yield from _in_thread(partial(_copy_result, job.output, kept), _READING)
            prepared = replace(prepared, result=replace(prepared.result, folder=kept))
    return prepared


def _job_key(job: DecomposeJob, environment: WorkerEnvironment) -> str:
    """The key of a job in the cache; "" if there can be none."""
    settings = astuple(replace(job, photo=Path(), output=Path(), mask=None, threads=0, cache=None))
    with suppress(OSError):
        job_files = (job.photo, job.mask)
        return content_key(job_files, map(str, settings), environment.search[0] / "isc_core")
    return ""


def _copy_result(source: Path, target: Path) -> None:
    shutil.copytree(source, target, ignore=shutil.ignore_patterns(ARRAYS))


def _with_time_left(
    updates: Generator[WorkerUpdate, None, WorkerUpdate], pace: Pace
) -> Generator[WorkerUpdate, None, WorkerUpdate]:
    """Updates with the fraction of the time that has passed, and the time left."""
    began = time.monotonic()
    try:
        while True:
            yield pace.at(next(updates), time.monotonic() - began)
    except StopIteration as stop:
        last: WorkerUpdate = stop.value
        return last
    finally:
        updates.close()


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
    """Find the object by its appearance.

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


def import_steps(result: Path, build: BuildOptions, environment: WorkerEnvironment) -> RunSteps:
    """Read a result folder; a worker first adds the arrays that Blender reads where it has none.

    Parameters
    ----------
    result : Path
        Result folder.
    build : BuildOptions
        What will be built from it.
    environment : WorkerEnvironment
        What the worker runs with.

    Returns
    -------
    RunOutput
        The result folder, and what is built from it.
    """
    if not (result / ARRAYS).is_file():
        yield from _run_worker(lambda: start_arrays(result, environment), {})
    made = partial(read_and_prepare, result, build, with_photo=True)
    prepared = yield from _in_thread(made, _READING)
    return RunOutput(result, _notes(result), prepared)


def read_and_prepare(
    folder: Path, build: BuildOptions, *, with_photo: bool = False
) -> tuple[PreparedObject, ...]:
    """Read a result, or those of each object of a photo, and do the slow part of building.

    Parameters
    ----------
    folder : Path
        A result, or with `build.each` the folder of results of objects.
    build : BuildOptions
        What will be built.
    with_photo : bool, optional
        Whether the masked photo becomes an image.

    Returns
    -------
    tuple of PreparedObject
        One object, or one for each object.

    Raises
    ------
    InputError
        If the folder cannot be read.
    """
    if not build.each:
        return (prepare(read_result(folder), build, with_photo=with_photo),)
    results = [read_result(one) for one in object_folders(folder)]
    return tuple(prepare_objects(results, build, with_photo=with_photo))


def _notes(result: Path) -> tuple[str, ...]:
    return tuple(translate_message(note, {}) for note in result_notes(result))


def _remark(result: Path) -> str:
    return _refinement_line(read_description(result / DESCRIPTION))


def _refinement_line(description: dict[str, Any]) -> str:
    settings = description.get("settings")
    return gloss_line(settings) if isinstance(settings, dict) else ""


def result_notes(result: Path) -> list[str]:
    """Return the notes on a result.

    Parameters
    ----------
    result : Path
        Result folder.

    Returns
    -------
    list of str
        For example why the solver stopped early, which assumptions do not hold, or what became of
        the gloss. Those that advise something begin with "note: ".

    Raises
    ------
    InputError
        If the folder is no result.
    """
    description = read_description(result / DESCRIPTION)
    source = description.get("input")
    stored = source.get("reading_notes") if isinstance(source, dict) else None
    lines = [*stored_note_lines(stored), *status_lines(description.get("status", {}))]
    return [*lines, *filter(None, [_refinement_line(description)])]


def _run_worker(
    start: Callable[[], WorkerProcess], names: Mapping[str, str]
) -> Generator[WorkerUpdate, None, WorkerUpdate]:
    """Start a worker and follow it; `names` are those of images by path, for its messages."""
    worker = yield from _in_thread(start, _STARTING, _kill_started)
    try:
        return (yield from follow_worker(worker))
    except WorkerFailed as failure:
        raise WorkerFailed(translate_message(str(failure), names), failure.log) from failure


def _in_thread(
    work: Callable[[], T],
    shown: WorkerUpdate,
    undo: Callable[[Future[T]], None] | None = None,
) -> Generator[WorkerUpdate, None, T]:
    """Run in a thread what could block the window; even starting a process may."""
    pool = ThreadPoolExecutor(1)
    working = pool.submit(work)
    pool.shutdown(wait=False)
    returned = False
    try:
        yield shown
        while not working.done():
            yield shown
        returned = True
        return working.result()
    finally:
        if not returned and undo is not None:  # cancelled in the meantime
            working.add_done_callback(undo)


def _kill_started(started: Future[WorkerProcess]) -> None:
    if started.exception() is None:
        started.result().kill()
