"""Running the stages over the scenes of a data set: each stage in isolation, then the chain under
every combination of ground truths.

Scenes run in parallel, one thread each; compiled kernels release the interpreter lock. Results do
not depend on the number of threads.
"""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from isc_core.errors import InputError
from isc_core.progress import Monitor
from isc_core.sirfs.kernel_cache import announce_compilation
from isc_core.sirfs.solver import SolverOptions, thread_count

from ...capture.truth import GroundTruth
from ...dataset.reading import SceneFacts, list_scenes, read_facts, read_truth
from ..stages.registry import all_stages
from ..stages.separation import SEPARATION
from ..stages.sirfs import SIRFS
from ..stages.types import AnyStage, StageOptions, stage_inputs
from .substitution import ChainScores, run_chain

_POLL_SECONDS = 0.2

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class ValidationOptions:
    """Options of a validation.

    Attributes
    ----------
    split : str or None
        The split to run, None for all.
    scenes : int
        Number of scenes, drawn by `seed`; 0 for all.
    stages : tuple of Stage
        The stages; empty for all.
    settings : StageOptions
        Options of the stages.
    seed : int
        Seed of all random draws.
    threads : int
        Number of scenes in parallel, 0 for one per core.
    """

    split: str | None = None
    scenes: int = 0
    stages: tuple[AnyStage, ...] = ()
    settings: StageOptions = field(default_factory=StageOptions)
    seed: int = 0
    threads: int = 0


@dataclass(frozen=True)
class StageResult:
    """The result of one stage on one scene.

    Attributes
    ----------
    stage : str
        Name of the stage.
    scores : dataclass
        Of the stage.
    seconds : float
        Run time.
    """

    stage: str
    scores: Any
    seconds: float


@dataclass(frozen=True)
class SceneResult:
    """The measurements of one scene.

    Attributes
    ----------
    facts : SceneFacts
        The scene's properties.
    stages : tuple of StageResult
        One per stage.
    chain : ChainScores or None
        None unless both of its stages were run.
    refused : str
        Reason why the scene could not be run; empty if it could.
    """

    facts: SceneFacts
    stages: tuple[StageResult, ...] = ()
    chain: ChainScores | None = None
    refused: str = ""

    def scores(self, stage: str) -> Any | None:
        """Return a stage's scores.

        Parameters
        ----------
        stage : str
            Name of the stage.

        Returns
        -------
        object or None
            Of the stage's own type; None if it was not run.
        """
        return next((result.scores for result in self.stages if result.stage == stage), None)


def choose_scenes(root: Path, options: ValidationOptions) -> tuple[Path, ...]:
    """Return the folders of the scenes to run, in the order of the data set.

    Parameters
    ----------
    root : Path
        Folder of the data set.
    options : ValidationOptions
        Split and number of scenes.

    Returns
    -------
    tuple of Path
        The folders.

    Raises
    ------
    InputError
        If there are none.
    """
    folders = list_scenes(root, options.split)
    if not folders:
        split = f" of the split {options.split!r}" if options.split else ""
        raise InputError(f"{root} has no scenes{split}: render some with isc synth")
    if not options.scenes or options.scenes >= len(folders):
        return folders
    chosen = np.random.default_rng(options.seed).choice(
        len(folders), size=options.scenes, replace=False
    )
    return tuple(folders[k] for k in sorted(chosen))


def run_scenes(
    folders: Sequence[Path], options: ValidationOptions, monitor: Monitor
) -> tuple[SceneResult, ...]:
    """Measure scenes.

    Parameters
    ----------
    folders : sequence of Path
        The scenes.
    options : ValidationOptions
        Stages and settings.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    tuple of SceneResult
        In the order of `folders`.

    Raises
    ------
    InputError
        If a folder cannot be read.
    Cancelled
        If the user cancels.
    """
    announce_compilation("auto", monitor)
    stages = options.stages or all_stages()

    def run(folder: Path, own: Monitor) -> SceneResult:
        return measure_scene(read_facts(folder), read_truth(folder), stages, options.settings, own)

    return side_by_side(run, folders, options.threads, "validating", monitor)


def measure_scene(
    facts: SceneFacts,
    truth: GroundTruth,
    stages: Sequence[AnyStage],
    settings: StageOptions,
    monitor: Monitor,
) -> SceneResult:
    """Run every stage in isolation on one scene, and the chain if both of its stages are present.

    Parameters
    ----------
    facts : SceneFacts
        The scene's properties.
    truth : GroundTruth
        Its ground truth.
    stages : sequence of Stage
        The stages.
    settings : StageOptions
        Options of the stages.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    SceneResult
        The scores, or the reason why the scene could not be run.

    Raises
    ------
    Cancelled
        If the user cancels.
    """
    answers: dict[str, Any] = {}
    results = []
    try:
        for stage in stages:
            start = time.perf_counter()
            inputs = replace(stage_inputs(truth, stage.needs), split=answers.get(SEPARATION.name))
            answers[stage.name] = stage.run(inputs, settings, monitor)
            seconds = time.perf_counter() - start
            results.append(
                StageResult(stage.name, stage.score(truth, answers[stage.name]), seconds)
            )
        chain = None
        if SEPARATION.name in answers and SIRFS.name in answers:
            alone = next(result.scores for result in results if result.stage == SIRFS.name)
            chain = run_chain(truth, answers[SEPARATION.name], alone, settings, monitor)
    except InputError as error:
        return SceneResult(facts, refused=str(error))
    return SceneResult(facts, tuple(results), chain)


def side_by_side(
    task: Callable[[Item, Monitor], Result],
    items: Sequence[Item],
    threads: int,
    what: str,
    monitor: Monitor,
) -> tuple[Result, ...]:
    """Process items in parallel threads.

    Parameters
    ----------
    task : callable
        ``task(item, monitor)``.
    items : sequence
        The items.
    threads : int
        Number in parallel, 0 for one per core.
    what : str
        Name of the work in progress reports.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    tuple
        The results in the order of `items`.

    Raises
    ------
    Exception
        Any exception of a task.
    Cancelled
        If the user cancels.
    """
    quiet = Monitor(cancelled=monitor.cancelled)
    results: dict[int, Result] = {}
    start = time.monotonic()
    with ThreadPoolExecutor(thread_count(SolverOptions(threads=threads))) as pool:
        futures: dict[Future[Result], int] = {
            pool.submit(task, item, quiet): k for k, item in enumerate(items)
        }
        waiting = set(futures)
        try:
            while waiting:
                monitor.report(
                    what,
                    len(results) / len(items),
                    _time_left(time.monotonic() - start, len(results), len(items)),
                )
                done, waiting = wait(waiting, _POLL_SECONDS, FIRST_COMPLETED)
                results.update({futures[future]: future.result() for future in done})
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    return tuple(results[k] for k in range(len(items)))


def _time_left(seconds: float, done: int, total: int) -> str:
    """Number of finished scenes and, after the first, the estimated remaining time."""
    if not done:
        return f"{total} scenes"
    left = seconds / done * (total - done)
    return f"{done} of {total}" + (
        f", {left:.0f} s left" if left < 90 else f", {left / 60:.0f} min left"
    )
