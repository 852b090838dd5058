"""Compare our solver, with the reference's priors, with the reference program: loss, scores, time.

python -m benchmarks.sirfs.solver_reference [--float64] [--engine numpy]
"""

import time

from benchmarks.program import run_program
from isc_core.datasets.mit_berkeley import list_objects
from isc_core.evaluation.metrics import geometric_mean
from isc_core.numerics.lbfgs import LbfgsOptions
from isc_core.sirfs.settings import published_weights
from isc_core.sirfs.solver import SolverOptions, solve

from .mit_berkeley import (
    LIGHTS,
    parser,
    problem,
    reference_results,
    scores,
    training_object,
    write_json,
)
from .reference_priors import reference_priors


def main() -> None:
    """Run the command line."""
    options = parser(__doc__)
    options.add_argument("--float64", action="store_true", help="use double precision")
    options.add_argument("--engine", default="auto", help="engine of the solver")
    options.add_argument("--threads", type=int, default=0, help="threads (default: all)")
    options.add_argument("--objects", help="comma-separated (default: all)")
    given = options.parse_args()
    solver = SolverOptions(
        engine=given.engine, single=not given.float64, threads=given.threads, lbfgs=LbfgsOptions()
    )
    figures: dict[str, object] = {}
    for light in LIGHTS:
        priors = reference_priors(given.shared / "anchors" / "sirfs_reference_priors.npz", light)
        theirs = reference_results(given.shared, light)
        names = (
            given.objects.split(",")
            if given.objects
            else list_objects(given.shared / "data" / "mit_berkeley_train", light)
        )
        averages, seconds, reference = [], [], []
        solve(
            problem(
                training_object(given.shared, names[0], light), priors, published_weights(light, 3)
            ),
            solver,
        )  # compiles
        for name in names:
            truth = training_object(given.shared, name, light)
            start = time.perf_counter()
            result = solve(problem(truth, priors, published_weights(light, 3)), solver)
            took = time.perf_counter() - start
            average = scores(truth, result).average
            averages.append(average)
            seconds.append(took)
            reference.append(theirs[name]["avg"])
            ratio = result.terms.total / theirs[name]["final_loss"]
            per = 1e3 * took / result.evaluations
            print(
                f"{light:10s} {name:9s} loss {result.terms.total:8.4f}  / reference {ratio:.5f}"
                f"  avg {average:.5f} ({theirs[name]['avg']:.5f})"
                f"  {result.evaluations:4d} evaluations of {per:.2f} ms  {took:.2f} s"
                f"  {result.reason}",
                flush=True,
            )
            figures[f"{light}/{name}"] = {
                "loss": result.terms.total,
                "ratio": ratio,
                "avg": average,
                "evaluations": result.evaluations,
                "seconds": took,
            }
        print(
            f"{light:10s} geometric means: avg {geometric_mean(averages):.5f} "
            f"({geometric_mean(reference):.5f}), time {geometric_mean(seconds):.2f} s"
        )
    write_json(given.json, figures)


if __name__ == "__main__":
    run_program(main)
