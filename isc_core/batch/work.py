"""The job of one image in a worker.

A worker processes one image at a time, whatever its number of threads, because the watchdog and the
peak memory are those of the process. The objects of a photo are decomposed one after the other,
each as a separate attempt, so that one that fails, hangs or kills its worker does not affect the
others.
"""

import shutil
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path, PurePath

from ..decomposition.pipeline import decompose
from ..errors import InputError
from ..masking.finder import MaskSearch, read_each_object
from ..photo import Photo, read_photo
from ..progress import Monitor
from ..result_files.contact_sheet import thumbnail
from ..result_files.object_folders import object_folders
from ..result_files.result_folder import require_room, require_writable_result, save
from ..sirfs.priors.prior_file import load_prior_set
from ..sirfs.priors.prior_set import PriorSet
from .fetch import is_url, local_copy, sha256
from .fingerprint import fingerprint, is_finished, recorded_input
from .item import DONE, FAILED, SKIPPED, ImageJob, ImageOutcome, Outcomes
from .outcome import Work, outcome_of
from .run_folder import RunFolder

_OBJECT_COUNT = "things"  # key in `input` of decomposition.json: the number of objects in the photo
_process_lock = threading.Lock()


@dataclass(frozen=True)
class _Files:
    """Local files of a job, and their checksums; "" for no mask."""

    photo: Path
    mask: Path | None
    photo_sha256: str
    mask_sha256: str

    @property
    def sums(self) -> tuple[str, str]:
        return self.photo_sha256, self.mask_sha256


def process(job: ImageJob, work: Work | None = None) -> Outcomes:
    """Decompose the job's image, or each of its objects, unless the results exist.

    Parameters
    ----------
    job : ImageJob
    work : callable, optional
        Replaces the decomposition, for tests. Returns the status.

    Returns
    -------
    Outcomes
        The outcome of the photo itself if its objects cannot be separated.
    """
    with _process_lock:
        if job.recipe.each and work is None:
            return _process_each(job)
        return {job.name: outcome_of(job, work or decompose_into)}


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
    with _fetched(job) as files:
        if _is_done(job, files):
            return SKIPPED
        monitor.report("reading", 0.0)
        recipe, limits = job.recipe, job.plan.limits
        with _locations_named(job, files):
            photo = read_photo(
                files.photo, files.mask, recipe.transfer, limits=limits, finder=MaskSearch()
            )
            _decompose(job, photo, files, {}, monitor)
    return DONE


def _process_each(job: ImageJob) -> Outcomes:
    with ExitStack() as stack:
        objects: list[tuple[_Files, Photo | None]] = []
        outcome = outcome_of(job, lambda job, monitor: _find(job, monitor, stack, objects))
        if outcome.status == FAILED:
            return {job.name: outcome}
        RunFolder(job.plan.output).begin_objects(job.name)
        parts = [job.of_object(number) for number in range(1, len(objects) + 1)]
        outcomes = {
            part.name: outcome_of(
                part, partial(_decompose_object, files=files, photo=photo, objects=len(objects))
            )
            for part, (files, photo) in zip(parts, objects, strict=True)
        }
    return outcomes | _remove_further(job, len(objects))


def _find(
    job: ImageJob, monitor: Monitor, stack: ExitStack, objects: list[tuple[_Files, Photo | None]]
) -> str:
    """Add the objects of a photo; they are not searched for if all results exist."""
    if recorded_input(job.folder):
        raise InputError(
            f"{job.folder} is the result of the whole photo: move it away, or leave out --each"
        )
    files = stack.enter_context(_fetched(job))
    if count := _finished_objects(job, files):
        objects += [(files, None)] * count
        return SKIPPED
    monitor.report("reading", 0.0)
    with _locations_named(job, files):
        photos = read_each_object(files.photo, files.mask, job.recipe.transfer, job.plan.limits)
    objects += [(files, photo) for photo in photos]
    return DONE


def _finished_objects(job: ImageJob, files: _Files) -> int:
    """The number of objects in the photo; 0 if a result is missing."""
    count = recorded_input(job.of_object(1).folder).get(_OBJECT_COUNT)
    if not isinstance(count, int):
        return 0
    parts = [job.of_object(number) for number in range(1, count + 1)]
    finished = (
        is_finished(part.folder, fingerprint(part, *files.sums), part.plan.arrays) for part in parts
    )
    return count if all(finished) else 0


def _decompose_object(
    job: ImageJob, monitor: Monitor, files: _Files, photo: Photo | None, objects: int
) -> str:
    if photo is None or _is_done(job, files):
        _draw_thumbnail(job, redraw=False)
        return SKIPPED
    with _locations_named(job, files):
        _decompose(job, photo, files, {"thing": job.object_number, _OBJECT_COUNT: objects}, monitor)
    return DONE


def _remove_further(job: ImageJob, count: int) -> dict[str, ImageOutcome]:
    """Remove results of additional objects that an earlier run found.

    Returns the failures: the outcomes of results that must stay.
    """
    failures = {}
    for number in (int(folder.name) for folder in object_folders(job.folder)):
        part = job.of_object(number)
        if number <= count or not recorded_input(part.folder).get(_OBJECT_COUNT):
            continue
        try:
            require_writable_result(part.folder)  # only a result is removed
            shutil.rmtree(part.folder)
            RunFolder(job.plan.output).thumbnail(part.name).unlink(missing_ok=True)
        except (InputError, OSError) as error:
            reason = f"the photo no longer shows this object, but its result stays: {error}"
            failures[part.name] = ImageOutcome(FAILED, reason)
    return failures


@contextmanager
def _fetched(job: ImageJob) -> Iterator[_Files]:
    plan, fetched = job.plan, RunFolder(job.plan.output).fetched
    with (
        local_copy(job.image, plan.limits, fetched) as photo,
        local_copy(job.mask, plan.limits, fetched) if job.mask else nullcontext() as mask,
    ):
        yield _Files(photo, mask, sha256(photo), "" if mask is None else sha256(mask))


@contextmanager
def _locations_named(job: ImageJob, files: _Files) -> Iterator[None]:
    """Let errors name the location of an input, not its temporary copy."""
    try:
        yield
    except InputError as error:
        message = str(error)
        for copy, location in ((files.photo, job.image), (files.mask, job.mask)):
            if copy is not None and is_url(location):
                message = message.replace(str(copy), location)
        raise InputError(message) from error


def _is_done(job: ImageJob, files: _Files) -> bool:
    done = is_finished(job.folder, fingerprint(job, *files.sums), job.plan.arrays)
    if done:
        _draw_thumbnail(job, redraw=False)
    return done


def _decompose(
    job: ImageJob, photo: Photo, files: _Files, more: dict[str, object], monitor: Monitor
) -> None:
    plan, recipe, mask = job.plan, job.recipe, files.mask
    if photo.original.sha256 != files.photo_sha256 or (
        mask is not None and sha256(mask) != files.mask_sha256
    ):
        raise InputError(f"{job.image} changed while it was read: run again when it is complete")
    require_room(job.folder, 0, arrays=plan.arrays)
    priors = _priors(plan.priors, plan.priors_sha256) if plan.priors else None
    name = PurePath(job.image).name
    result = decompose(
        photo, recipe.settings, prior_set=priors, name=name, monitor=monitor.part(0.0, 0.8)
    )
    source = {
        **result.provenance.input,
        "mask_sha256": files.mask_sha256 or None,
        "fingerprint": fingerprint(job, *files.sums),
        **more,
    }
    result = replace(result, provenance=replace(result.provenance, input=source))
    writing = monitor.part(0.8, 1.0)
    save(result, job.folder, arrays=plan.arrays, cover=photo.cover, monitor=writing)
    _draw_thumbnail(job, redraw=True)


@lru_cache(maxsize=2)
def _priors(path: str, expected: str) -> PriorSet:
    if sha256(Path(path)) != expected:
        raise InputError(
            f"{path} changed after the run was started: all workers must read the same priors"
        )
    return load_prior_set(Path(path))


def _draw_thumbnail(job: ImageJob, *, redraw: bool) -> None:
    """Draw the thumbnail, in a separate folder."""
    target = RunFolder(job.plan.output).thumbnail(job.name)
    if redraw or not target.is_file():
        thumbnail(job.folder / "preview.png", target)
