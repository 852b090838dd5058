"""Scores of a method on each object of the MIT-Berkeley set, and comparison of two methods.

Problem: errors with different units, on few objects, have to be summarised, with an uncertainty.

Equation: each error of `evaluation.metrics.Scores` is summarised by its geometric mean over the
objects, so that no object and no unit dominates. Two methods are compared by the ratio of their
geometric means; its interval comes from resampling the objects.

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712; B. Efron 1979, "Bootstrap
methods: another look at the jackknife", doi:10.1214/aos/1176344552.

Limits: with ten objects the percentile interval is somewhat too narrow, and objects of one family
(two cups, two frogs) are not independent.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..datasets.mit_berkeley import (
    MitBerkeleyObject,
    check_request,
    list_objects,
    load_object,
    usual_illuminations,
)
from ..errors import InputError
from ..progress import Monitor
from .metrics import Scores, geometric_mean, require_truth, score

_HEADINGS = (
    "light",
    "object",
    "Z-MAE px",
    "N-MAE rad",
    "S-MSE",
    "R-MSE",
    "RS-MSE",
    "L-MSE",
    "avg",
    "loss",
    "s",
)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A method's estimate for one object, on the object's crop.

    Attributes
    ----------
    height : (h, w) ndarray
        Pixels toward the viewer.
    normal : (h, w, 3) ndarray
        Unit vectors, camera frame: x right, y up, z toward the viewer.
    shading, reflectance : (h, w, 3) ndarray
        Linear, used where the input is valid.
    light : (9, 3) ndarray
        Log-shading SH coefficients, ISC's convention.
    loss : float or None
        The solver's final objective.
    evaluations : int or None
        The solver's evaluations.
    """

    height: np.ndarray
    normal: np.ndarray
    shading: np.ndarray
    reflectance: np.ndarray
    light: np.ndarray
    loss: float | None = None
    evaluations: int | None = None


# A method under evaluation: it uses the object's `image`, `valid` and `mask`, never the ground
# truth, and reports its progress.
Runner = Callable[[MitBerkeleyObject, Monitor], Estimate]


@dataclass(frozen=True)
class ObjectResult:
    """Errors of one object.

    Attributes
    ----------
    name, illumination : str
        The object.
    valid_pixels : int
        Number of valid pixels.
    scores : Scores
        The errors.
    loss : float or None
        The solver's final objective.
    evaluations : int or None
        The solver's evaluations.
    seconds : float
        Run time.
    """

    name: str
    illumination: str
    valid_pixels: int
    scores: Scores
    loss: float | None
    evaluations: int | None
    seconds: float


@dataclass(frozen=True)
class EvaluationReport:
    """Errors of a method on a set of objects.

    Attributes
    ----------
    model : str
        Name of the method.
    input : str
        "diffuse" or "original".
    results : tuple of ObjectResult
        One for each object and illumination, in the order of the runs.
    protocol : str
        The evaluation protocol, see `runner.Protocol`.
    """

    model: str
    input: str
    results: tuple[ObjectResult, ...]
    protocol: str = "reference"

    @property
    def illuminations(self) -> tuple[str, ...]:
        """The illuminations, in the order of the results."""
        return tuple(dict.fromkeys(result.illumination for result in self.results))

    def under(self, illumination: str) -> tuple[ObjectResult, ...]:
        """Return the results under one illumination.

        Parameters
        ----------
        illumination : str
            One of `illuminations`.

        Returns
        -------
        tuple of ObjectResult
        """
        return tuple(result for result in self.results if result.illumination == illumination)

    def mean(self, illumination: str) -> Scores:
        """Compute the geometric means over the objects under one illumination.

        Parameters
        ----------
        illumination : str
            One of `illuminations`.

        Returns
        -------
        Scores
            Their `average` is the geometric mean of the objects' averages.
        """
        rows = [asdict(result.scores) for result in self.under(illumination)]
        return Scores(**{name: geometric_mean(row[name] for row in rows) for name in rows[0]})

    def mean_seconds(self, illumination: str) -> float:
        """Return the geometric mean of the seconds per object.

        Parameters
        ----------
        illumination : str
            One of `illuminations`.

        Returns
        -------
        float
        """
        return geometric_mean(result.seconds for result in self.under(illumination))

    def to_json(self) -> dict[str, Any]:
        """Return the report as JSON values; the sets are named "illumination/input"."""
        return {
            "dataset": "mit-berkeley",
            "model": self.model,
            "input": self.input,
            "protocol": self.protocol,
            "geometric_means": {
                f"{light}/{self.input}": _scores_json(self.mean(light))
                | {"seconds": self.mean_seconds(light)}
                for light in self.illuminations
            },
            "results": {
                f"{light}/{self.input}": {
                    result.name: _result_json(result) for result in self.under(light)
                }
                for light in self.illuminations
            },
        }

    def table(self) -> str:
        """Return an aligned Markdown table: one row per object, and the geometric mean below each
        illumination.
        """
        rows: list[tuple[str, ...]] = [_HEADINGS]
        for light in self.illuminations:
            rows += [_row(light, r.name, r.scores, r.loss, r.seconds) for r in self.under(light)]
            rows.append(
                _row(light, "geometric mean", self.mean(light), None, self.mean_seconds(light))
            )
        return _markdown(rows)


class Ratio(NamedTuple):
    """A ratio of geometric means, below 1 where the first method has smaller errors.

    Attributes
    ----------
    ratio : float
        The ratio.
    low, high : float
        Its 95 % interval.
    """

    ratio: float
    low: float
    high: float


def evaluate(
    root: str | Path,
    *,
    objects: Sequence[str] | None = None,
    illuminations: Sequence[str] | None = None,
    input: str = "diffuse",
    model: str,
    protocol: str = "reference",
    runner: Runner,
    monitor: Monitor | None = None,
) -> EvaluationReport:
    """Run a method on objects of the set, and score its estimates.

    Parameters
    ----------
    root : path
        Folder of the data set.
    objects : sequence of str, optional
        Names; all objects by default.
    illuminations : sequence of str, optional
        "natural", "laboratory"; those of `usual_illuminations` by default.
    input : str, optional
        "diffuse" or "original" (laboratory light, or a set of `isc synth glossy-mit`).
    model : str
        Name of the method in the report.
    protocol : str, optional
        Name of the protocol in the report.
    runner : Runner
        The method.
    monitor : Monitor, optional
        Receives progress.

    Returns
    -------
    EvaluationReport
        One result for each object and illumination.

    Raises
    ------
    InputError
        If a name or option is unknown, or an object cannot be read or scored; before the first run.
    Cancelled
        If the monitor cancels; between objects.
    """
    monitor = monitor or Monitor()
    if illuminations is None:
        illuminations = usual_illuminations(root, input)
    pairs = [
        (light, name)
        for light in illuminations
        for name in (list_objects(root, light) if objects is None else objects)
    ]
    jobs = list(dict.fromkeys(pairs))
    if not jobs:
        raise InputError("nothing to evaluate: name at least one object and one illumination")
    for light, name in jobs:
        check_request(root, name, light, input)
    for light, name in jobs:  # read again below: a large set does not fit in memory
        require_truth(load_object(root, name, light, input))
    results = []
    for done, (light, name) in enumerate(jobs):
        part = monitor.part(done / len(jobs), (done + 1) / len(jobs))
        part.report(f"{name}, {light}", 0.0)
        results.append(_run(load_object(root, name, light, input), runner, part))
    monitor.report("evaluated", 1.0)
    return EvaluationReport(model, input, tuple(results), protocol)


def paired_bootstrap(
    log_avg_a: Iterable[float], log_avg_b: Iterable[float], seed: int, *, resamples: int = 10_000
) -> Ratio:
    """Compare two methods on the same objects, with the percentile interval of resampled objects.

    Parameters
    ----------
    log_avg_a, log_avg_b : iterable of float
        Natural logarithm of each method's error on each object (the mean over its lights, where
        there are several).
    seed : int
        Of the resampling.
    resamples : int, optional
        Number of resamples.

    Returns
    -------
    Ratio
        a / b of the geometric means.

    Raises
    ------
    ValueError
        If there are fewer than two objects, unequal lengths or values that are not finite.
    """
    a, b = (np.asarray(list(values), float) for values in (log_avg_a, log_avg_b))
    if a.ndim != 1 or a.shape != b.shape or a.size < 2 or not np.isfinite([a, b]).all():
        raise ValueError(
            "a paired comparison needs the same two or more objects with finite values, not "
            f"{a.shape} and {b.shape}"
        )
    difference = a - b
    drawn = np.random.default_rng(seed).integers(0, a.size, size=(resamples, a.size))
    low, high = np.quantile(difference[drawn].mean(axis=1), [0.025, 0.975])
    return Ratio(math.exp(difference.mean()), math.exp(low), math.exp(high))


def _run(truth: MitBerkeleyObject, runner: Runner, monitor: Monitor) -> ObjectResult:
    start = time.perf_counter()
    estimate = runner(truth, monitor)
    seconds = time.perf_counter() - start
    scores = score(
        truth,
        height=estimate.height,
        normal=estimate.normal,
        shading=estimate.shading,
        reflectance=estimate.reflectance,
        light=estimate.light,
    )
    return ObjectResult(
        truth.name,
        truth.illumination,
        int(truth.valid.sum()),
        scores,
        estimate.loss,
        estimate.evaluations,
        seconds,
    )


def _scores_json(scores: Scores) -> dict[str, float]:
    return asdict(scores) | {"avg": scores.average}


def _result_json(result: ObjectResult) -> dict[str, Any]:
    solver = {"final_loss": result.loss, "evaluations": result.evaluations}
    return _scores_json(result.scores) | {
        "valid_pixels": result.valid_pixels,
        **solver,
        "seconds": result.seconds,
    }


def _row(
    light: str, name: str, scores: Scores, loss: float | None, seconds: float
) -> tuple[str, ...]:
    errors = (
        f"{scores.normal:.4f}",
        *(f"{x:.5f}" for x in (scores.shading, scores.reflectance, scores.rs_mse, scores.light)),
    )
    return (
        light,
        name,
        f"{scores.height:.2f}",
        *errors,
        f"{scores.average:.5f}",
        "" if loss is None else f"{loss:.3f}",
        f"{seconds:.2f}",
    )


def _markdown(rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table of rows, the first one the heading: two columns of text, then numbers."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rules = ["-" * width if k < 2 else "-" * (width - 1) + ":" for k, width in enumerate(widths)]
    lines = []
    for row in (rows[0], rules, *rows[1:]):
        cells = [
            cell.ljust(width) if k < 2 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
