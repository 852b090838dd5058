"""Compare production (float32, compiled) with double precision and with the NumPy engine.

  python -m benchmarks.sirfs.precision
  python -m benchmarks.sirfs.precision --numpy

The first form compares losses and scores of the ten objects under both lights; `--numpy` compares
ten fixed states and whole solves in both engines, with the ratio of their times. Priors and weights
are the shipped ones.
"""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.program import run_program
from isc_core.datasets.mit_berkeley import list_objects
from isc_core.evaluation.metrics import geometric_mean
from isc_core.numerics.thread_pool import ThreadPool
from isc_core.sirfs.numba_engine import NumbaEngine
from isc_core.sirfs.numpy_engine import NumpyEngine
from isc_core.sirfs.priors.prior_file import shipped_prior_set
from isc_core.sirfs.problem import Problem
from isc_core.sirfs.settings import isc_weights
from isc_core.sirfs.solver import SirfsResult, SolverOptions, solve

from .mit_berkeley import LIGHTS, parser, problem, scores, training_object


def timed(function: Callable[[], SirfsResult]) -> tuple[SirfsResult, float]:
    """Call a function and measure its time.

    Parameters
    ----------
    function : callable
        Takes no arguments and solves a problem.

    Returns
    -------
    result : SirfsResult
        What the function returned.
    seconds : float
        Wall time of the call.
    """
    start = time.perf_counter()
    return function(), time.perf_counter() - start


def against_double(shared: Path, names: list[str]) -> None:
    """Print final losses and scores in both precisions.

    Parameters
    ----------
    shared : Path
        Folder with data/.
    names : list of str
        The objects.
    """
    for light in LIGHTS:
        priors, weights = shipped_prior_set().priors(light, 3), isc_weights(light, 3)
        averages: dict[bool, list[float]] = {True: [], False: []}
        seconds, evaluations = [], []
        for k, name in enumerate(names):
            truth = training_object(shared, name, light)
            made = problem(truth, priors, weights)
            if k == 0:
                solve(made)  # compiles
            losses = {}
            for single in (True, False):
                result, took = timed(partial(solve, made, SolverOptions(single=single)))
                losses[single] = result.terms.total
                averages[single].append(scores(truth, result).average)
                if single:
                    seconds.append(took)
                    evaluations.append(result.evaluations)
            print(
                f"{light:10s} {name:9s} loss {losses[True]:.4f}, float64 {losses[False]:.4f}, "
                f"ratio {losses[True] / losses[False]:.5f}; "
                f"avg {averages[True][-1]:.5f} / {averages[False][-1]:.5f}; "
                f"{seconds[-1]:.2f} s, {evaluations[-1]} evaluations of "
                f"{1e3 * seconds[-1] / evaluations[-1]:.2f} ms",
                flush=True,
            )
        both = geometric_mean(averages[True]), geometric_mean(averages[False])
        print(
            f"{light:10s} geometric means: avg {both[0]:.5f} / {both[1]:.5f}, "
            f"ratio {both[0] / both[1]:.4f}; {geometric_mean(seconds):.2f} s, "
            f"{geometric_mean([float(e) for e in evaluations]):.0f} evaluations"
        )


def states(made: Problem) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return ten heights and lights, from flat to steep.

    Parameters
    ----------
    made : Problem
        The problem whose image size applies.

    Returns
    -------
    list of ((H, W) ndarray, (9, 3) ndarray)
        Height in pixels and SH coefficients of log shading.
    """
    rng = np.random.default_rng(0)
    i, j = np.mgrid[: made.valid.shape[0], : made.valid.shape[1]]
    found = []
    for k in range(10):
        a, b = rng.uniform(10, 40, 2)
        found.append(
            (
                2.0 * k * np.sin(i / a + k) * np.cos(j / b),
                0.1 * k * rng.normal(size=(9, 3)) * (k > 0),
            )
        )
    return found


def against_numpy(shared: Path, names: list[str]) -> None:
    """Print the differences of both engines, at ten states and in whole solves.

    Parameters
    ----------
    shared : Path
        Folder with data/.
    names : list of str
        The objects.
    """
    for light in LIGHTS:
        priors, weights = shipped_prior_set().priors(light, 3), isc_weights(light, 3)
        for name in names:
            made = problem(training_object(shared, name, light), priors, weights)
            for dtype in (np.float64, np.float32):
                worst = np.zeros(3)
                with ThreadPool(2) as workers:
                    compiled, plain = NumbaEngine(made, dtype, workers), NumpyEngine(made, dtype)
                    for height, lit in states(made):
                        a, b = (
                            compiled.evaluate(height.astype(dtype), lit),
                            plain.evaluate(height.astype(dtype), lit),
                        )
                        pairs = (
                            (a.height_gradient, b.height_gradient),
                            (a.light_gradient, b.light_gradient),
                        )
                        differences = [
                            float(np.linalg.norm(x - y) / np.linalg.norm(y)) for x, y in pairs
                        ]
                        worst = np.maximum(
                            worst, np.array([abs(a.terms.total / b.terms.total - 1), *differences])
                        )
                print(
                    f"{light:10s} {name:9s} {dtype.__name__}: loss {worst[0]:.1e}, "
                    f"dZ {worst[1]:.1e}, dL {worst[2]:.1e}",
                    flush=True,
                )
            fast, fast_s = timed(partial(solve, made, SolverOptions(engine="numba")))
            slow, slow_s = timed(partial(solve, made, SolverOptions(engine="numpy")))
            each = (slow_s / slow.evaluations) / (fast_s / fast.evaluations)
            print(
                f"{light:10s} {name:9s} whole solve: "
                f"loss ratio {slow.terms.total / fast.terms.total:.5f}, "
                f"time {slow_s:.1f} / {fast_s:.2f} s = {slow_s / fast_s:.1f}, "
                f"per evaluation {each:.1f}",
                flush=True,
            )


def main() -> None:
    """Run the command line."""
    options = parser(__doc__)
    options.add_argument("--numpy", action="store_true", help="compare the engines")
    options.add_argument("--objects", help="comma-separated (default: all)")
    given = options.parse_args()
    names = (
        given.objects.split(",")
        if given.objects
        else list(list_objects(given.shared / "data" / "mit_berkeley_train", "natural"))
    )
    (against_numpy if given.numpy else against_double)(given.shared, names)


if __name__ == "__main__":
    run_program(main)
