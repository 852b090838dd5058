"""One run of a batch, from its inputs to its summary."""

import os
import secrets
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from .. import __version__
from ..errors import Cancelled, InputError
from ..io.limits import DEFAULT_LIMITS, Limits
from ..progress import Monitor
from ..sirfs.priors.prior_file import load_prior_set
from .engine import WorkerOptions, connected, dashboard, require_dask, run_jobs
from .fetch import is_url, sha256
from .item import SKIPPED, BatchItem, ImageJob, ImageOutcome, ImageRecipe, Outcomes, RunPlan
from .journal import Journal, JournalEntry
from .names import Names
from .run_folder import RunFolder
from .sources import Inputs
from .summary import write_summary
from .work import process

_RECENT = 200  # number of images from whose rate the remaining time is estimated


@dataclass(frozen=True)
class Batch:
    """A batch run.

    Attributes
    ----------
    inputs : sequence of str
        Photos, folders, patterns, manifests.
    output : Path
        The folder to write.
    masks : str or None
        A folder of masks; None for masks next to the photos.
    recipe : ImageRecipe
    worker_options : WorkerOptions
    limits : Limits
    timeout : float
        Seconds per image; 0 for no limit.
    arrays : bool
        Whether to write `arrays.npz`.
    priors : Path or None
        A file of `isc fit-priors`.
    """

    inputs: Sequence[str]
    output: Path
    masks: str | None = None
    recipe: ImageRecipe = field(default_factory=ImageRecipe)
    worker_options: WorkerOptions = field(default_factory=WorkerOptions)
    limits: Limits = DEFAULT_LIMITS
    timeout: float = 0.0
    arrays: bool = False
    priors: Path | None = None


def run_batch(
    batch: Batch,
    monitor: Monitor | None = None,
    announce: Callable[[str], None] = lambda line: None,
    task: Callable[[ImageJob], Outcomes] = process,
) -> Counter[str]:
    """Decompose every image that has no result yet.

    Complete results are kept, however the run ends.

    Parameters
    ----------
    batch : Batch
    monitor : Monitor, optional
    announce : callable
        Receives one line for the user at the start.
    task : callable
        Processes a job in a worker.

    Returns
    -------
    Counter
        Number of results by status: one for each image, or for each of its objects.

    Raises
    ------
    InputError
        If the run as a whole is invalid, before work begins.
    Cancelled
        If the user cancels.
    """
    monitor = monitor or Monitor()
    require_dask()
    worker_options = batch.worker_options.sized()
    worker_options.check()
    recipe = replace(
        batch.recipe, settings=replace(batch.recipe.settings, threads=worker_options.threads)
    )
    recipe.settings.check()
    plan = _plan(batch)
    folder = RunFolder(plan.output)
    monitor.report("reading the inputs", 0.0)
    inputs = Inputs(batch.inputs, batch.masks, recipe, plan.output)
    if next(iter(inputs), None) is None:  # before the folder is created
        raise InputError(
            f"{', '.join(batch.inputs)}: names no image: give photos, or a manifest with rows"
        )
    with folder.locked(plan.run):
        names = Names(_cancellable(inputs, monitor))
        monitor.report("starting workers", 0.0)
        # The journal replaces that of the previous run, so only a run that can begin opens it.
        with (
            connected(worker_options) as client,
            Journal(folder, names.count) as journal,
        ):
            try:
                announce("; ".join([_counted(names.count), *dashboard(client)]))
                progress = _Progress(journal, monitor)
                for job, outcomes in run_jobs(
                    client, _jobs(inputs, names, recipe, plan, journal), progress.tick, task
                ):
                    journal.add(*_entries(job, outcomes))
                    progress.count(outcomes)
            finally:
                write_summary(folder, journal)
        return journal.counts


def _entries(job: ImageJob, outcomes: Outcomes) -> list[JournalEntry]:
    return [
        JournalEntry(job.number, name, job.image, job.mask, outcome)
        for name, outcome in outcomes.items()
    ]


def _counted(number: int) -> str:
    return f"{number} image{'s' * (number != 1)}"


def _plan(batch: Batch) -> RunPlan:
    if batch.priors is not None:
        load_prior_set(batch.priors)
    return RunPlan(
        output=Path(os.path.abspath(batch.output.expanduser())),
        run=secrets.token_hex(8),
        version=__version__,
        limits=batch.limits,
        timeout=batch.timeout,
        arrays=batch.arrays,
        priors="" if batch.priors is None else os.path.abspath(batch.priors),
        priors_sha256="" if batch.priors is None else sha256(batch.priors),
    )


def _cancellable(inputs: Inputs, monitor: Monitor) -> Iterator[BatchItem]:
    """The inputs; cancellable, because listing them can be slow."""
    for number, item in enumerate(inputs):
        if number % 10_000 == 0 and monitor.cancelled():
            raise Cancelled("reading the inputs")
        yield item


def _jobs(
    inputs: Inputs, names: Names, recipe: ImageRecipe, plan: RunPlan, journal: Journal
) -> Iterator[ImageJob]:
    """The jobs, as a stream; repeated items are skipped."""
    for number, item in enumerate(inputs):
        name = names.name(item)
        image, mask = _absolute(item.image), _absolute(item.mask)
        if name is None:
            outcome = ImageOutcome(SKIPPED, "repeated in the inputs")
            journal.add(JournalEntry(number, "", image, mask, outcome))
            continue
        changed = recipe.changed(item.options) if item.options else recipe
        yield ImageJob(number, name, image, mask, changed, plan)


def _absolute(location: str) -> str:
    return location if not location or is_url(location) else os.path.abspath(location)


class _Progress:
    """Reports progress, rate and remaining time to the monitor."""

    def __init__(self, journal: Journal, monitor: Monitor) -> None:
        self._journal, self._monitor = journal, monitor
        self._recent: deque[float] = deque([time.monotonic()], maxlen=_RECENT)

    def count(self, outcomes: Outcomes) -> None:
        """Count an image; skipped ones do not enter the estimate of the remaining time."""
        if any(outcome.status != SKIPPED for outcome in outcomes.values()):
            self._recent.append(time.monotonic())

    def tick(self) -> None:
        """Report; raises `Cancelled`."""
        counts, total = self._journal.counts, self._journal.total
        finished = sum(counts.values())
        self._monitor.report(
            "images", finished / total, f"done {counts['done']}, {self._detail(total - finished)}"
        )

    def _detail(self, left: int) -> str:
        counts = self._journal.counts
        text = f"failed {counts['failed']}, skipped {counts['skipped']}, {left} left"
        rate = (len(self._recent) - 1) / max(time.monotonic() - self._recent[0], 1e-6)
        if rate == 0:
            return text
        minutes, seconds = divmod(round(left / rate), 60)
        return f"{text}, {rate:.2g}/s, {minutes // 60}:{minutes % 60:02d}:{seconds:02d} to go"
