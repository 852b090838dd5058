"""Measure the priors on unseen objects: solve each training object with priors fitted to the rest.

  python -m benchmarks.sirfs.leave_one_out --json loo.json
  python -m benchmarks.sirfs.leave_one_out --in-sample
  python -m benchmarks.sirfs.leave_one_out --grey

The first form compares baseline B (the published recipe and weights) with ours, under both lights;
`--in-sample` fits the priors to all ten objects; `--grey` removes the colours of the photos (for
grey photos in natural light no weights are published; those for laboratory light are used).

Both lights of the object are left out: the priors know neither its shape nor its albedo nor its
lights. The statistics of the ten objects are condensed once; a fold is a fit to nine of them. The
comparison is paired: the ratio of geometric means with a 95 % bootstrap interval over objects. Each
object is a family of its own: these ten have one member each of the cups, frogs, papers and
teabags.
"""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.program import run_program
from isc_core.datasets.mit_berkeley import load_natural_lights
from isc_core.evaluation.evaluate import paired_bootstrap
from isc_core.evaluation.metrics import geometric_mean
from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.prior_fitting.fit import PUBLISHED, FitOptions, fit_priors
from isc_core.prior_fitting.statistics import ObjectStatistics, collect_statistics
from isc_core.prior_fitting.training_objects import read_training_objects
from isc_core.sirfs.priors.prior_set import PriorSet
from isc_core.sirfs.settings import isc_weights, published_weights
from isc_core.sirfs.solver import SolverOptions, solve

from .mit_berkeley import LIGHTS, greyed, parser, problem, scores, training_object, write_json

METHODS = ("B", "B, lights scaled", "ours")
METRICS = ("height", "normal", "shading", "reflectance", "rs_mse", "light")


@dataclass(frozen=True)
class SolveJob:
    """One solve.

    Attributes
    ----------
    method : str
        One of `METHODS`.
    name, light : str
        The object and its illumination.
    priors : PriorSet
        The fold's priors.
    shared : Path
        Folder with data/.
    grey : bool
        Remove the colours.
    """

    method: str
    name: str
    light: str
    priors: PriorSet
    shared: Path
    grey: bool = False


def fit_options(method: str) -> FitOptions:
    """Return how the priors of a method are fitted.

    "B, lights scaled" is the recipe with the contrast of the natural lights fitted to the objects.

    Parameters
    ----------
    method : str
        One of `METHODS`.

    Returns
    -------
    FitOptions
    """
    return {
        "B": PUBLISHED,
        "B, lights scaled": PUBLISHED.with_fitted_contrast(),
        "ours": FitOptions(),
    }[method]


def run_job(job: SolveJob) -> tuple[str, str, str, list[float], float]:
    """Solve one object.

    Parameters
    ----------
    job : SolveJob
        The solve.

    Returns
    -------
    method, light, name : str
        From the job.
    errors : list of float
        In the order of `METRICS`.
    loss : float
        Final loss.
    """
    channels = 1 if job.grey else 3
    weights = (
        isc_weights(job.light, channels)
        if job.method == "ours"
        else published_weights(job.light, channels)
    )
    truth = training_object(job.shared, job.name, job.light)
    truth = greyed(truth) if job.grey else truth
    priors = job.priors.priors(job.light, channels)
    if job.method != "ours":
        priors = priors.without_silhouette()
    options = (
        SolverOptions(threads=1)
        if job.method == "ours"
        else SolverOptions(threads=1, lbfgs=LbfgsOptions())
    )  # the published rule
    result = solve(problem(truth, priors, weights), options)
    errors = scores(truth, result)
    return (
        job.method,
        job.light,
        job.name,
        [getattr(errors, metric) for metric in METRICS],
        result.terms.total,
    )


def solve_jobs(
    shared: Path, methods: tuple[str, ...], in_sample: bool, grey: bool
) -> list[SolveJob]:
    """Fit the folds and list all solves.

    Parameters
    ----------
    shared : Path
        Folder with data/.
    methods : tuple of str
        Of `METHODS`.
    in_sample : bool
        Fit the priors to all objects.
    grey : bool
        Remove the colours.

    Returns
    -------
    list of SolveJob
        By method, object and light.
    """
    root = shared / "data" / "mit_berkeley_train"
    statistics = collect_statistics(read_training_objects(root))
    lights = load_natural_lights(root)
    made = []
    for method in methods:
        whole = fit_priors(statistics, lights, fit_options(method)) if in_sample else None
        for name in statistics:
            fold = whole or fit_priors(without(statistics, name), lights, fit_options(method))
            made += [SolveJob(method, name, light, fold, shared, grey) for light in LIGHTS]
    return made


def without(statistics: dict[str, ObjectStatistics], name: str) -> dict[str, ObjectStatistics]:
    """Return the statistics of the other objects.

    Parameters
    ----------
    statistics : dict of str to ObjectStatistics
        By object.
    name : str
        The object to omit.

    Returns
    -------
    dict of str to ObjectStatistics
    """
    return {key: value for key, value in statistics.items() if key != name}


def main() -> None:
    """Run the command line."""
    options = parser(__doc__)
    options.add_argument(
        "--in-sample", action="store_true", help="fit the priors to all ten objects"
    )
    options.add_argument("--grey", action="store_true", help="remove the colours of the photos")
    options.add_argument(
        "--methods",
        default=",".join(METHODS).replace("B, lights scaled", "scaled"),
        help="comma-separated: B, scaled, ours",
    )
    options.add_argument("--processes", type=int, default=2, help="parallel processes")
    given = options.parse_args()
    methods = tuple("B, lights scaled" if m == "scaled" else m for m in given.methods.split(","))
    results: dict[tuple[str, str], dict[str, list[float]]] = {}
    with ProcessPoolExecutor(given.processes) as pool:
        for method, light, name, errors, loss in pool.map(
            run_job, solve_jobs(given.shared, methods, given.in_sample, given.grey)
        ):
            results.setdefault((method, light), {})[name] = errors
            print(
                f"{method:18s} {light:10s} {name:9s} "
                f"avg {geometric_mean(errors):.5f}  loss {loss:.3f}",
                flush=True,
            )
    report(results)
    write_json(given.json, {f"{m}/{light}": found for (m, light), found in results.items()})


def report(results: dict[tuple[str, str], dict[str, list[float]]]) -> None:
    """Print the geometric means by method and light, and the ratios to B.

    Parameters
    ----------
    results : dict of (str, str) to dict
        By method and illumination, the errors of each object: Z, N, S, R, RS, L.
    """
    print(
        "\n| light | priors | Z px | N rad | S-MSE | R-MSE | RS-MSE | L-MSE | avg |\n"
        + "|---" * 9
        + "|"
    )
    for (method, light), found in sorted(results.items(), key=lambda item: item[0][1]):
        means = np.exp(np.mean([np.log(errors) for errors in found.values()], axis=0))
        row = [
            f"{means[0]:.2f}",
            f"{means[1]:.4f}",
            *(f"{v:.5f}" for v in means[2:]),
            f"{geometric_mean(list(means)):.5f}",
        ]
        print(f"| {light} | {method} | " + " | ".join(row) + " |")
    for light in LIGHTS:
        for baseline in METHODS[:2]:
            if (baseline, light) in results and ("ours", light) in results:
                theirs, ours = results[baseline, light], results["ours", light]
                logs = [
                    [np.mean(np.log(found[name])) for name in sorted(ours)]
                    for found in (ours, theirs)
                ]
                ratio = paired_bootstrap(logs[0], logs[1], seed=0)
                print(
                    f"{light}: ours / {baseline} = {ratio.ratio:.3f}, "
                    f"95 % interval {ratio.low:.3f} to {ratio.high:.3f}"
                )


if __name__ == "__main__":
    run_program(main)
