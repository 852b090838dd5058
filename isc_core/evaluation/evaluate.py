"""Scoring a method on the MIT-Berkeley set, object by object, and comparing two methods.

Each error of `evaluation.metrics.Scores` is summed up by its geometric mean over the objects (J. T. Barron, J.
Malik 2015, doi:10.1109/TPAMI.2014.2377712), so that no single object or unit decides. Two methods
are compared by the ratio of their geometric means; its interval comes from resampling the objects
(B. Efron 1979, "Bootstrap methods: another look at the jackknife", doi:10.1214/aos/1176344552).

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

from ..datasets.mit_berkeley import MitBerkeleyObject, check_request, list_objects, load_object
from ..errors import InputError
from ..progress import Monitor
from .metrics import Scores, geometric_mean, score

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


@dataclass(frozen=True)
class Estimate:
    """A method's answer for one object, on the object's crop (h, w), in the project's conventions.

    `height`: (h, w) pixels toward the viewer. `normal`: (h, w, 3) unit vectors, x right, y up, z
    toward the viewer. `shading`, `reflectance`: (h, w, 3) linear, read where the input is valid.
    `light`: (9, 3) coefficients of orthonormal real spherical harmonics of log shading. `loss`,
    `evaluations`: of the solver at its end, where it has them.
    """

    height: np.ndarray
    normal: np.ndarray
    shading: np.ndarray
    reflectance: np.ndarray
    light: np.ndarray
    loss: float | None = None
    evaluations: int | None = None


# What is evaluated: it sees the object's `image`, `valid` and `mask`, reports its progress, and
# must not look at the truth.
Runner = Callable[[MitBerkeleyObject, Monitor], Estimate]


@dataclass(frozen=True)
class ObjectResult:
    """One object's errors, the solver's final loss and evaluations (None where it has none), and
    the seconds that it took.
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
    """The errors of `model` on `input` images: one result for each object and illumination, in the
    order they were run.
    """

    model: str
    input: str
    results: tuple[ObjectResult, ...]

    @property
    def illuminations(self) -> tuple[str, ...]:
        """The illuminations that were run, in order."""
        return tuple(dict.fromkeys(result.illumination for result in self.results))

    def under(self, illumination: str) -> tuple[ObjectResult, ...]:
        """The results under one illumination."""
        return tuple(result for result in self.results if result.illumination == illumination)

    def mean(self, illumination: str) -> Scores:
        """Geometric means over the objects; the `average` of these is the geometric mean of the
        objects' averages.
        """
        rows = [asdict(result.scores) for result in self.under(illumination)]
        return Scores(**{name: geometric_mean(row[name] for row in rows) for name in rows[0]})

    def mean_seconds(self, illumination: str) -> float:
        """Geometric mean of the seconds an object."""
        return geometric_mean(result.seconds for result in self.under(illumination))

    def to_json(self) -> dict[str, Any]:
        """The report as values for `json.dump`; the sets are named "illumination/input"."""
        return {
            "dataset": "mit-berkeley",
            "model": self.model,
            "input": self.input,
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
        """The report as an aligned Markdown table: a row an object, and the geometric mean below
        each illumination.
        """
        rows: list[tuple[str, ...]] = [_HEADINGS]
        for light in self.illuminations:
            rows += [_row(light, r.name, r.scores, r.loss, r.seconds) for r in self.under(light)]
            rows.append(
                _row(light, "geometric mean", self.mean(light), None, self.mean_seconds(light))
            )
        return _markdown(rows)


class Ratio(NamedTuple):
    """A ratio of geometric means and its 95 % interval; below 1, the first method errs less."""

    ratio: float
    low: float
    high: float


def evaluate(
    root: str | Path,
    *,
    objects: Sequence[str] | None = None,
    illuminations: Sequence[str] = ("natural", "laboratory"),
    input: str = "diffuse",
    model: str,
    runner: Runner,
    monitor: Monitor | None = None,
) -> EvaluationReport:
    """Runs `runner` on the objects below `root` and scores its answers.

    `objects`: names, or None for all. `input`: "diffuse" or "original" (laboratory only). `model`:
    what the report calls the method. Raises `InputError` for unknown names or options before the
    first run, and `Cancelled` between objects.
    """
    monitor = monitor or Monitor()
    wanted = [
        (light, name)
        for light in illuminations
        for name in (list_objects(root, light) if objects is None else objects)
    ]
    jobs = list(dict.fromkeys(wanted))
    if not jobs:
        raise InputError("nothing to evaluate: name at least one object and one illumination")
    for light, name in jobs:
        check_request(root, name, light, input)
    results = []
    for done, (light, name) in enumerate(jobs):
        part = monitor.part(done / len(jobs), (done + 1) / len(jobs))
        part.report(f"{name}, {light}", 0.0)
        results.append(_run(load_object(root, name, light, input), runner, part))
    monitor.report("evaluated", 1.0)
    return EvaluationReport(model, input, tuple(results))


def paired_bootstrap(
    log_avg_a: Iterable[float], log_avg_b: Iterable[float], seed: int, *, resamples: int = 10_000
) -> Ratio:
    """The ratio a / b of two geometric means over the same objects, with the percentile interval of
    resampled objects.

    `log_avg_a[k]`, `log_avg_b[k]`: natural logarithm of the two methods' errors on object k (the
    mean over its lights, where there are several). Raises `ValueError` for fewer than two objects,
    unequal lengths or values that are not finite.
    """
    a, b = (np.asarray(list(values), float) for values in (log_avg_a, log_avg_b))
    if a.ndim != 1 or a.shape != b.shape or a.size < 2 or not np.isfinite([a, b]).all():
        raise ValueError(
            f"a paired comparison needs the same two or more objects with finite values, not {a.shape} and {b.shape}"
        )
    difference = a - b
    drawn = np.random.default_rng(seed).integers(0, a.size, size=(resamples, a.size))
    low, high = np.quantile(difference[drawn].mean(axis=1), [0.025, 0.975])
    return Ratio(math.exp(difference.mean()), math.exp(low), math.exp(high))


def _run(truth: MitBerkeleyObject, runner: Runner, monitor: Monitor) -> ObjectResult:
    start = time.perf_counter()
    answer = runner(truth, monitor)
    seconds = time.perf_counter() - start
    scores = score(
        truth,
        height=answer.height,
        normal=answer.normal,
        shading=answer.shading,
        reflectance=answer.reflectance,
        light=answer.light,
    )
    return ObjectResult(
        truth.name,
        truth.illumination,
        int(truth.valid.sum()),
        scores,
        answer.loss,
        answer.evaluations,
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
    """Rows of cells, the first of them the heading, as a Markdown table: two columns of text, then
    numbers.
    """
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
