"""Where should SIRFS begin? Its objective has many minima, and the start decides into which it
goes: several, on objects not seen.

  python -m benchmarks.sirfs.starts                                     the MIT-Berkeley objects as they
  are python -m benchmarks.sirfs.starts --others 0,2,4,6                    each under four of the other
  objects' lights python -m benchmarks.sirfs.starts --scenes FOLDER                     rendered scenes of
  `isc synth`

A start is "dome:light", how much of the outline's dome and of the expected light
(`sirfs.settings.Start`); "1:0.5+0:0.5" tries two. MIT-Berkeley objects are solved with priors
fitted to the other nine; under another's light the picture is their paint times the shading of
their shape. Of a rendered scene the true diffuse layer is solved with the priors that ship, at 256
pixels and as bright as photos are; its light is not compared. Errors are over the first start's,
geometric means; a rounding changes the picture's last digits. Cases in which the starts' avg
differs by more than half are printed, with each start's avg over the best and its final loss:
whether the loss tells which minimum is the worse.
"""

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import MitBerkeleyObject, list_objects, load_natural_lights
from isc_core.decompose.shape import exposure_normalisation
from isc_core.evaluation.metrics import Scores, truth_normal
from isc_core.prior_fitting.fit import FitOptions, fit_priors
from isc_core.prior_fitting.statistics import collect_statistics
from isc_core.prior_fitting.training_objects import read_training_objects
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    normal_from_reference,
    real_sh,
)
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.priors.prior_set import PriorSet
from isc_core.sirfs.recover import RecoverOptions, recover
from isc_core.sirfs.settings import Start, Weights, isc_weights
from isc_core.sirfs.solver import SolverOptions, solve
from synth.dataset.reading import list_scenes, read_truth
from synth.validation.stages.sirfs import score_sirfs, with_normals
from synth.validation.stages.types import BLACK, StageInputs

from .leave_one_out import METRICS, without
from .mit_berkeley import (
    LIGHTS,
    parser,
    problem,
    rounded,
    rounded_image,
    scores,
    training_object,
    write_json,
)

Starts = tuple[Start, ...]
_APART = 1.5


@dataclass(frozen=True)
class Task:
    """One solve: of an object under its own light or, with `other`, under that object's, or of a
    scene's folder (`priors` then None).
    """

    case: str
    starts: Starts
    rounding: int
    light: str
    shared: Path
    other: str | None = None
    priors: PriorSet | None = None


@dataclass(frozen=True)
class Found:
    """Six errors (five of a scene, NaN last) and the final loss."""

    task: Task
    errors: tuple[float, ...]
    loss: float

    @property
    def average(self) -> float:
        """The geometric mean of the errors."""
        return float(np.exp(np.nanmean(np.log(self.errors))))


def run(task: Task) -> Found:
    """Solves from the task's start."""
    weights = replace(isc_weights(task.light, 3), starts=task.starts)
    return (
        _of_scene(task, weights) if task.priors is None else _of_object(task, task.priors, weights)
    )


def _of_object(task: Task, priors: PriorSet, weights: Weights) -> Found:
    truth = training_object(task.shared, task.case, task.light)
    if task.other is not None:
        truth = _lit(truth, training_object(task.shared, task.other, task.light).light)
    truth = rounded(truth, task.rounding)
    result = solve(problem(truth, priors.priors(task.light, 3), weights), SolverOptions(threads=1))
    return _found(task, scores(truth, result), result.terms.total)


def _lit(truth: MitBerkeleyObject, light: np.ndarray) -> MitBerkeleyObject:
    """The object under `light` (9, 3), reference convention: its paint times the shading of its
    shape.
    """
    normal = truth_normal(truth.height)
    known = np.isfinite(normal).all(axis=-1, keepdims=True) & truth.valid[..., None]
    shading = np.where(
        known, np.exp(real_sh(np.where(known, normal, 0)) @ light_from_reference(light)), 0
    )
    image = truth.reflectance * shading
    return replace(truth, image=image, valid=(image > 0).all(axis=-1), shading=shading, light=light)


def _of_scene(task: Task, weights: Weights) -> Found:
    truth = read_truth(task.case)
    diffuse = rounded_image(np.maximum(truth.diffuse, 0).astype(float), task.rounding)
    gain = exposure_normalisation(diffuse, truth.mask)
    options = RecoverOptions(solver=SolverOptions(threads=1))
    result = recover(
        diffuse * gain,
        truth.mask,
        BLACK,
        shipped_prior_set().priors(task.light, 3),
        weights,
        options,
    )
    normal = normal_from_reference(normals(result.height))
    seen = StageInputs(truth.image, truth.mask, np.zeros_like(truth.mask), diffuse)
    errors = score_sirfs(
        truth, with_normals(seen, result.height, normal, light_from_reference(result.light))
    )
    return _found(task, replace(errors, light=np.nan), result.terms.total)


def _found(task: Task, errors: Scores, loss: float) -> Found:
    return Found(task, tuple(float(getattr(errors, metric)) for metric in METRICS), loss)


def object_tasks(ways: Sequence[Starts], given: argparse.Namespace) -> Iterator[Task]:
    """All solves of MIT-Berkeley objects; fits the folds."""
    root = given.shared / "data" / "mit_berkeley_train"
    statistics, lights = collect_statistics(read_training_objects(root)), load_natural_lights(root)
    for name in list_objects(root, given.light):
        fold = fit_priors(without(statistics, name), lights, FitOptions())
        names = [other for other in list_objects(root, given.light) if other != name]
        for other in [names[k] for k in given.others] or [None]:
            for rounding in range(given.roundings):
                yield from (
                    Task(name, starts, rounding, given.light, given.shared, other, fold)
                    for starts in ways
                )


def scene_tasks(ways: Sequence[Starts], given: argparse.Namespace) -> Iterator[Task]:
    """All solves of rendered scenes."""
    for folder in list_scenes(given.scenes):
        for rounding in range(given.roundings):
            yield from (
                Task(str(folder), starts, rounding, given.light, given.shared) for starts in ways
            )


def report(found: Sequence[Found], ways: Sequence[Starts]) -> None:
    """A row a start, and the cases in which the starts are far apart."""
    cases: dict[tuple[str, str | None, int], dict[Starts, Found]] = {}
    for one in found:
        cases.setdefault((one.task.case, one.task.other, one.task.rounding), {})[
            one.task.starts
        ] = one
    print(
        f"\n{len(cases)} cases\n\n| start | "
        + " | ".join(METRICS)
        + " | avg | standard error |\n"
        + "|---" * 9
        + "|"
    )
    for starts in ways:
        ratios = np.log([[*by[starts].errors, by[starts].average] for by in cases.values()])
        ratios -= np.log([[*by[ways[0]].errors, by[ways[0]].average] for by in cases.values()])
        cells = [
            "-" if np.isnan(value) else f"{value:.3f}" for value in np.exp(ratios.mean(axis=0))
        ]
        print(
            f"| {_words(starts)} | {' | '.join(cells)} | {ratios[:, -1].std() / np.sqrt(len(cases)):.3f} |"
        )
    for (case, other, rounding), by in cases.items():
        best = min(one.average for one in by.values())
        if max(one.average for one in by.values()) > _APART * best:
            each = (
                f"{_words(starts)} {one.average / best:.2f} at {one.loss:.2f}"
                for starts, one in by.items()
            )
            print(
                f"{Path(case).name}{f' under the light of {other}' if other else ''}, rounding {rounding}: "
                + ", ".join(each)
            )


def main() -> None:
    """Runs and prints."""
    options = parser(__doc__)
    options.add_argument(
        "--starts",
        type=_ways,
        default=_ways("0:0,1:0,0:0.5,1:0.5,1:1,1:0.5+0:0.5"),
        help="dome:light, ...",
    )
    options.add_argument("--light", choices=LIGHTS, default=LIGHTS[0])
    options.add_argument(
        "--others",
        type=lambda text: [int(k) for k in text.split(",")],
        default=[],
        help="of the nine other lights",
    )
    options.add_argument("--scenes", type=Path, help="a folder of isc synth")
    options.add_argument("--roundings", type=int, default=1)
    options.add_argument("--processes", type=int, default=2)
    given = options.parse_args()
    tasks = (
        object_tasks(given.starts, given)
        if given.scenes is None
        else scene_tasks(given.starts, given)
    )
    with ProcessPoolExecutor(given.processes) as pool:
        found = list(pool.map(run, tasks))
    report(found, given.starts)
    write_json(given.json, [_row(one) for one in found])


def _row(found: Found) -> tuple[object, ...]:
    """A case, its start, what was compared and the loss, JSON-ready."""
    task, errors = found.task, [None if np.isnan(error) else error for error in found.errors]
    return task.case, task.other, task.rounding, _words(task.starts), errors, found.loss


def _ways(text: str) -> list[Starts]:
    return [
        tuple(Start(*(float(part) for part in pair.split(":"))) for pair in way.split("+"))
        for way in text.split(",")
    ]


def _words(starts: Starts) -> str:
    return "+".join(f"{start.dome:g}:{start.light:g}" for start in starts)


if __name__ == "__main__":
    main()
