"""Building a world: every object of the list is loaded and traced from a few sides.

Problem: a few thousand objects, each a second or less, on all processors, and resumable.

Equation: the random numbers of reference number k are those of the sequence (seed, k), so that
neither the order of the work nor an interruption changes a view.

Limits: an object of which one side shows too little loses its reference.
"""

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from isc_core.errors import Cancelled, InputError
from isc_core.io.atomic import new_file
from isc_core.progress import Monitor

from .bodies.sources import BodyFolders, BodyReference, body_names
from .files import (
    CREDITS,
    PATTERN_COUNT,
    PATTERNS,
    VIEWS,
    WorldSettings,
    claim_folder,
    read_views,
    write_patterns,
    write_views,
)
from .patterns import make_atlas
from .views import View, trace_view

_TASKS = 200  # of a worker process, before a fresh one takes over: Blender's memory grows
_AHEAD = 4  # tasks that wait for each worker


def build_world(
    folder: Path,
    sources: BodyFolders,
    settings: WorldSettings,
    count: int | None,
    workers: int,
    monitor: Monitor,
) -> list[str]:
    """Build a world, or continue it.

    Parameters
    ----------
    folder : Path
    sources : BodyFolders
    settings : WorldSettings
    count : int or None
        References to take from the list; None: all.
    workers : int
        Processes.
    monitor : Monitor

    Returns
    -------
    list of str
        Lines that describe the result.

    Raises
    ------
    InputError
        If the folder holds something else.
    Cancelled
        If the monitor cancels; the build can be continued.
    """
    references = body_names(sources, settings.seed, settings.built, settings.families)
    references = references[:count]
    if not references:
        raise InputError("the list of objects is empty: name a folder of objects or a number")
    claim_folder(folder, settings)
    paths = [folder / VIEWS / f"{k:05d}.npz" for k in range(len(references))]
    if not (folder / PATTERNS).exists():
        monitor.report("patterns", 0)
        write_patterns(folder, make_atlas(settings.seed, PATTERN_COUNT))
    missing = [k for k, path in enumerate(paths) if not path.exists()]
    done = len(references) - len(missing)
    for _ in _built(missing, references, paths, settings, workers, monitor):
        done += 1
        monitor.report("bodies", done / len(references), f"{done} of {len(references)}")
    return _summary(folder, references, paths)


def _built(
    missing: list[int],
    references: list[BodyReference],
    paths: list[Path],
    settings: WorldSettings,
    workers: int,
    monitor: Monitor,
) -> Iterator[int]:
    """Build the missing references; yields the number of each when it is written."""
    waiting, running = list(reversed(missing)), dict[Future[None], int]()
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), max_tasks_per_child=_TASKS)
    with pool:
        while waiting or running:
            while waiting and len(running) < _AHEAD * workers:
                k = waiting.pop()
                task = pool.submit(_build_one, paths[k], references[k], settings, k)
                running[task] = k
            ended, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
            for task in ended:
                task.result()
                yield running.pop(task)
            if monitor.cancelled():
                for task in running:
                    task.cancel()
                raise Cancelled


def _build_one(path: Path, reference: BodyReference, settings: WorldSettings, k: int) -> None:
    """Write the views of a reference; in a worker process."""
    rng = np.random.default_rng([settings.seed, k])
    views: list[View] = []
    try:
        bodies = reference.load()
        reason = "" if bodies else "no object passes the screening"
        views = [
            trace_view(body.name, str(body.source), body.mesh, rng)
            for body in bodies
            for _ in range(settings.views)
        ]
    except InputError as error:
        reason = str(error)
    write_views(path, reference.name, views, reason)


def _summary(folder: Path, references: list[BodyReference], paths: list[Path]) -> list[str]:
    """Write the credits, and describe the world."""
    credits_, views, bodies, empty = list[str](), 0, 0, 0
    for reference, path in zip(references, paths, strict=True):
        found = read_views(path)[1]
        views, bodies = views + len(found), bodies + len({view.name for view in found})
        empty += not found
        if found:
            credits_.append(f"{reference.name}: {reference.credit}")
    with new_file(folder / CREDITS) as temporary:
        temporary.write_text("\n".join(credits_) + "\n", encoding="utf-8")
    return [f"{folder}: {views} views of {bodies} objects; {empty} entries of the list have none"]
