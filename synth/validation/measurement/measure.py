"""Runs the stages over the scenes of a dataset: each stage by itself, then the chain under every
combination of truths.

Scenes run side by side, a thread each: compiled kernels release the interpreter. What comes out
does not depend on how many.
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
    """`split`: the one to run, None for all. `scenes`: how many, drawn by `seed` without order; 0
    for all. `stages`: which. `settings`: of the stages. `threads`: how many scenes at once, 0 for
    one on each core.
    """

    split: str | None = None
    scenes: int = 0
    stages: tuple[AnyStage, ...] = ()
    settings: StageOptions = field(default_factory=StageOptions)
    seed: int = 0
    threads: int = 0


@dataclass(frozen=True)
class StageResult:
    """One stage's scores (a dataclass of its own) on one scene, and the seconds that it took."""

    stage: str
    scores: Any
    seconds: float


@dataclass(frozen=True)
class SceneResult:
    """What was measured on one scene. `chain`: None unless both of its stages were asked for.
    `refused`: why the scene could not be run, empty where it could.
    """

    facts: SceneFacts
    stages: tuple[StageResult, ...] = ()
    chain: ChainScores | None = None
    refused: str = ""

    def scores(self, stage: str) -> Any | None:
        """A stage's scores, None where it was not run."""
        return next((result.scores for result in self.stages if result.stage == stage), None)


def choose_scenes(root: Path, options: ValidationOptions) -> tuple[Path, ...]:
    """The folders of the scenes to run, in their order in the dataset.

    Raises `InputError` where there are none.
    """
    folders = list_scenes(root, options.split)
    if not folders:
        raise InputError(
            f"{root} holds no scenes"
            + (f" of the split {options.split!r}" if options.split else "")
            + ": make some by isc synth"
        )
    if not options.scenes or options.scenes >= len(folders):
        return folders
    chosen = np.random.default_rng(options.seed).choice(
        len(folders), size=options.scenes, replace=False
    )
    return tuple(folders[k] for k in sorted(chosen))


def run_scenes(
    folders: Sequence[Path], options: ValidationOptions, monitor: Monitor
) -> tuple[SceneResult, ...]:
    """Measures scenes. Raises `InputError` for a folder that cannot be read, `Cancelled`."""
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
    """Every stage by itself on one scene, and the chain if both of its stages are among them."""
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
    """`task` of every item, in the items' order, some at once.

    Raises what a task raised, and `Cancelled`.
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
                    f"{what}{_time_left(time.monotonic() - start, len(results), len(items))}",
                    len(results) / len(items),
                )
                done, waiting = wait(waiting, _POLL_SECONDS, FIRST_COMPLETED)
                results.update({futures[future]: future.result() for future in done})
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
    return tuple(results[k] for k in range(len(items)))


def _time_left(seconds: float, done: int, total: int) -> str:
    """How far the work is and, after the first item, how long the rest may take."""
    if not done:
        return f" {total} scenes"
    left = seconds / done * (total - done)
    return f" {done} of {total}" + (
        f", {left:.0f} s left" if left < 90 else f", {left / 60:.0f} min left"
    )
