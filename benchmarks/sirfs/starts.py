"""Compare starting points of SIRFS, whose objective has many minima, on unseen objects.

  python -m benchmarks.sirfs.starts
  python -m benchmarks.sirfs.starts --others 0,2,4,6
  python -m benchmarks.sirfs.starts --scenes FOLDER

The first form solves the MIT-Berkeley objects; `--others` relights each by four of the other
objects' lights; `--scenes` solves rendered scenes of `isc synth`.

A start is "dome:light", the shares of the silhouette's dome and of the expected light
(`isc_core.sirfs.settings.Start`); "1:0.5+0:0.5" tries two. MIT-Berkeley objects are solved with
priors fitted to the other nine; a relit image is the reflectance times the shading of the shape. Of
a rendered scene, the true diffuse layer is solved with the shipped priors at 256 pixels, exposed
like a photo; its light is not compared. Errors are geometric means relative to the first start; a
rounding perturbs the last digits of the image. Cases in which the average errors of the starts
differ by more than half are printed, with each start's error over the best and its final loss:
whether the loss identifies the worse minimum.
"""

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.program import run_program
from isc_core.datasets.mit_berkeley import MitBerkeleyObject, list_objects, load_natural_lights
from isc_core.decomposition.shape import exposure_normalisation
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
class StartJob:
    """One solve.

    Attributes
    ----------
    case : str
        Name of the object, or folder of the scene.
    starts : tuple of Start
        Starting points.
    rounding : int
        Number of the perturbation.
    light : str
        Illumination.
    shared : Path
        Folder with data/.
    other : str or None
        Object that lends its light.
    priors : PriorSet or None
        The fold's priors; None for a scene.
    """

    case: str
    starts: Starts
    rounding: int
    light: str
    shared: Path
    other: str | None = None
    priors: PriorSet | None = None


@dataclass(frozen=True)
class StartResult:
    """Result of a solve.

    Attributes
    ----------
    job : StartJob
        The solve.
    errors : tuple of float
        In the order of `METRICS`; of a scene, the light's is NaN.
    loss : float
        Final loss.
    """

    job: StartJob
    errors: tuple[float, ...]
    loss: float

    @property
    def average(self) -> float:
        """Geometric mean of the errors."""
        return float(np.exp(np.nanmean(np.log(self.errors))))


def run_job(job: StartJob) -> StartResult:
    """Solve from the starts of a job.

    Parameters
    ----------
    job : StartJob
        An object, or a scene if it has no priors.

    Returns
    -------
    StartResult
    """
    weights = replace(isc_weights(job.light, 3), starts=job.starts)
    return _of_scene(job, weights) if job.priors is None else _of_object(job, job.priors, weights)


def _of_object(job: StartJob, priors: PriorSet, weights: Weights) -> StartResult:
    truth = training_object(job.shared, job.case, job.light)
    if job.other is not None:
        truth = _lit(truth, training_object(job.shared, job.other, job.light).light)
    truth = rounded(truth, job.rounding)
    result = solve(problem(truth, priors.priors(job.light, 3), weights), SolverOptions(threads=1))
    return _found(job, scores(truth, result), result.terms.total)


def _lit(truth: MitBerkeleyObject, light: np.ndarray) -> MitBerkeleyObject:
    """The object under `light` (9, 3), reference convention: reflectance times shading."""
    normal = truth_normal(truth.height)
    known = np.isfinite(normal).all(axis=-1, keepdims=True) & truth.valid[..., None]
    shading = np.where(
        known, np.exp(real_sh(np.where(known, normal, 0)) @ light_from_reference(light)), 0
    )
    image = truth.reflectance * shading
    return replace(truth, image=image, valid=(image > 0).all(axis=-1), shading=shading, light=light)


def _of_scene(job: StartJob, weights: Weights) -> StartResult:
    truth = read_truth(job.case)
    diffuse = rounded_image(np.maximum(truth.diffuse, 0).astype(float), job.rounding)
    gain = exposure_normalisation(diffuse, truth.mask)
    options = RecoverOptions(solver=SolverOptions(threads=1))
    result = recover(
        diffuse * gain,
        truth.mask,
        BLACK,
        shipped_prior_set().priors(job.light, 3),
        weights,
        options,
    )
    normal = normal_from_reference(normals(result.height))
    inputs = StageInputs(truth.image, truth.mask, np.zeros_like(truth.mask), diffuse)
    errors = score_sirfs(
        truth, with_normals(inputs, result.height, normal, light_from_reference(result.light))
    )
    return _found(job, replace(errors, light=np.nan), result.terms.total)


def _found(job: StartJob, errors: Scores, loss: float) -> StartResult:
    return StartResult(job, tuple(float(getattr(errors, metric)) for metric in METRICS), loss)


def object_jobs(ways: Sequence[Starts], given: argparse.Namespace) -> Iterator[StartJob]:
    """Fit the folds and list all solves of the MIT-Berkeley objects.

    Parameters
    ----------
    ways : sequence of tuple of Start
        Starts to compare.
    given : argparse.Namespace
        The command's options.

    Yields
    ------
    StartJob
        The solves.
    """
    root = given.shared / "data" / "mit_berkeley_train"
    statistics, lights = collect_statistics(read_training_objects(root)), load_natural_lights(root)
    for name in list_objects(root, given.light):
        fold = fit_priors(without(statistics, name), lights, FitOptions())
        names = [other for other in list_objects(root, given.light) if other != name]
        for other in [names[k] for k in given.others] or [None]:
            for rounding in range(given.roundings):
                yield from (
                    StartJob(name, starts, rounding, given.light, given.shared, other, fold)
                    for starts in ways
                )


def scene_jobs(ways: Sequence[Starts], given: argparse.Namespace) -> Iterator[StartJob]:
    """List all solves of rendered scenes.

    Parameters
    ----------
    ways : sequence of tuple of Start
        Starts to compare.
    given : argparse.Namespace
        The command's options.

    Yields
    ------
    StartJob
        The solves.
    """
    for folder in list_scenes(given.scenes):
        for rounding in range(given.roundings):
            yield from (
                StartJob(str(folder), starts, rounding, given.light, given.shared)
                for starts in ways
            )


def report(found: Sequence[StartResult], ways: Sequence[Starts]) -> None:
    """Print one row per start, and the cases in which the starts differ much.

    Parameters
    ----------
    found : sequence of StartResult
        Results of all cases and starts.
    ways : sequence of tuple of Start
        The starts to compare; ratios are relative to the first.
    """
    cases: dict[tuple[str, str | None, int], dict[Starts, StartResult]] = {}
    for one in found:
        cases.setdefault((one.job.case, one.job.other, one.job.rounding), {})[one.job.starts] = one
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
            f"| {_start_text(starts)} | {' | '.join(cells)} "
            f"| {_standard_error(ratios[:, -1], [case for case, _, _ in cases])} |"
        )
    for (case, other, rounding), by in cases.items():
        best = min(one.average for one in by.values())
        if max(one.average for one in by.values()) > _APART * best:
            each = (
                f"{_start_text(starts)} {one.average / best:.2f} at {one.loss:.2f}"
                for starts, one in by.items()
            )
            print(
                f"{Path(case).name}{f' under the light of {other}' if other else ''}, "
                f"rounding {rounding}: " + ", ".join(each)
            )


def _standard_error(ratios: np.ndarray, objects: Sequence[str]) -> str:
    """Format the standard error of the mean over objects: lights and roundings of one are alike."""
    places = np.unique(objects, return_inverse=True)[1]
    means = np.bincount(places, ratios) / np.bincount(places)
    return f"{means.std(ddof=1) / np.sqrt(len(means)):.3f}" if len(means) > 1 else "-"


def main() -> None:
    """Run the command line."""
    options = parser(__doc__)
    options.add_argument(
        "--starts",
        type=_ways,
        default=_ways("0:0,1:0,0:0.5,1:0.5,1:1,1:0.5+0:0.5"),
        help="comma-separated starts, dome:light each",
    )
    options.add_argument("--light", choices=LIGHTS, default=LIGHTS[0], help="illumination")
    options.add_argument(
        "--others",
        type=lambda text: [int(k) for k in text.split(",")],
        default=[],
        help="comma-separated indices of the nine other lights",
    )
    options.add_argument("--scenes", type=Path, help="a run of isc synth")
    options.add_argument("--roundings", type=int, default=1, help="perturbations")
    options.add_argument("--processes", type=int, default=2, help="parallel processes")
    given = options.parse_args()
    jobs = (
        object_jobs(given.starts, given)
        if given.scenes is None
        else scene_jobs(given.starts, given)
    )
    with ProcessPoolExecutor(given.processes) as pool:
        found = list(pool.map(run_job, jobs))
    report(found, given.starts)
    write_json(given.json, [_row(one) for one in found])


def _row(found: StartResult) -> tuple[object, ...]:
    """A case, its start, errors and loss, ready for JSON."""
    job, errors = found.job, [None if np.isnan(error) else error for error in found.errors]
    return job.case, job.other, job.rounding, _start_text(job.starts), errors, found.loss


def _ways(text: str) -> list[Starts]:
    return [tuple(_start(pair) for pair in way.split("+")) for way in text.split(",")]


def _start(text: str) -> Start:
    dome, light = (float(part) for part in text.split(":"))
    return Start(dome, light)


def _start_text(starts: Starts) -> str:
    return "+".join(f"{start.dome:g}:{start.light:g}" for start in starts)


if __name__ == "__main__":
    run_program(main)
