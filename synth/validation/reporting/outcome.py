"""The result of a whole validation, and its JSON form."""

import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

import isc_core

from ..checks.render_checks import RenderCheck
from ..measurement.bounds import Verdict
from ..measurement.figures import Figure
from ..measurement.gains import Gain
from ..measurement.measure import SceneResult, ValidationOptions
from ..measurement.substitution import COMBINATIONS, METRICS, Budget, budget
from ..stages.models import Variants
from ..stages.types import Metric

SCHEMA_VERSION = 2  # 2: the gloss class "matt" is called "diffuse"
_PACKAGES = ("numpy", "scipy", "numba", "mitsuba")


@dataclass(frozen=True)
class ValidationOutcome:
    """The result of a validation.

    Attributes
    ----------
    dataset, command : str
        The data set as named on the command line, and the command that repeats the run.
    options : ValidationOptions
        What was run.
    scenes : tuple of SceneResult
        All scenes, those that could not be run included.
    figures : tuple of Figure
        Every metric over every slice.
    budgets : tuple of Budget
        Error budgets; empty if the chain was not run.
    checks : tuple of RenderCheck
        Checks of the data set.
    verdicts : tuple of Verdict
        Results of the bounds.
    notes : tuple of str
        Remarks for the reader.
    gains : tuple of Gain
        Gains of the models; empty without the stage "models".
    """

    dataset: str
    command: str
    options: ValidationOptions
    scenes: tuple[SceneResult, ...]
    figures: tuple[Figure, ...]
    budgets: tuple[Budget, ...]
    checks: tuple[RenderCheck, ...]
    verdicts: tuple[Verdict, ...]
    notes: tuple[str, ...] = ()
    gains: tuple[Gain, ...] = ()

    @property
    def measured(self) -> tuple[SceneResult, ...]:
        """The scenes that could be run."""
        return tuple(scene for scene in self.scenes if not scene.refused)

    @property
    def failures(self) -> tuple[str, ...]:
        """One line per violated bound and per failed check."""
        return tuple(v.text for v in self.verdicts if v.broken) + tuple(
            check.text for check in self.checks if not check.passed
        )


def all_budgets(scenes: Sequence[SceneResult], seed: int) -> tuple[Budget, ...]:
    """Compute the error budget of every metric of the chain.

    Parameters
    ----------
    scenes : sequence of SceneResult
        The scenes; those without a chain are skipped.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    tuple of Budget
        Empty if the chain was run on no scene.
    """
    chains = [scene.chain for scene in scenes if scene.chain is not None]
    return tuple(budget(metric, chains, seed) for metric in METRICS) if chains else ()


def versions() -> dict[str, str]:
    """Return the versions of ISC, Python and the packages that affect the figures."""
    found = {"isc": isc_core.__version__, "python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def to_json(outcome: ValidationOutcome, evidence: Sequence[str]) -> dict[str, Any]:
    """Convert a validation to JSON values.

    Parameters
    ----------
    outcome : ValidationOutcome
        The validation.
    evidence : sequence of str
        Files with maps of rejected scenes, relative to the report.

    Returns
    -------
    dict
        The content of `report.json`.
    """
    options = outcome.options
    return {
        "schema_version": SCHEMA_VERSION,
        "accepted": not outcome.failures,
        "dataset": outcome.dataset,
        "command": outcome.command,
        "versions": versions(),
        "settings": {
            "split": options.split,
            "scenes": options.scenes,
            "seed": options.seed,
            "stages": [stage.name for stage in options.stages],
            "separator": options.settings.separator,
            "illumination": options.settings.illumination,
            "models": list(options.settings.models),
        },
        "notes": list(outcome.notes),
        "failures": list(outcome.failures),
        "evidence": list(evidence),
        "figures": [_figure(figure) for figure in outcome.figures],
        "gains": [_gain(gain) for gain in outcome.gains],
        "budget": [_budget(found) for found in outcome.budgets],
        "checks": [_check(check) for check in outcome.checks],
        "bounds": [asdict(verdict) for verdict in outcome.verdicts],
        "scenes": [_scene(scene) for scene in outcome.scenes],
    }


def _figure(figure: Figure) -> dict[str, Any]:
    group = {"kind": figure.group.kind, "value": figure.group.value}
    return {
        "stage": figure.stage,
        "metric": _metric(figure.metric),
        "slice": group,
        "interval": asdict(figure.interval),
    }


def _gain(gain: Gain) -> dict[str, Any]:
    group = {"kind": gain.group.kind, "value": gain.group.value}
    return {"model": gain.model, "error": gain.error, "slice": group, "share": asdict(gain.share)}


def _metric(metric: Metric) -> dict[str, Any]:
    kind = "geometric" if metric.geometric else "arithmetic"
    return {
        "name": metric.name,
        "unit": metric.unit,
        "mean": kind,
        "larger_is_better": metric.larger_is_better,
    }


def _budget(found: Budget) -> dict[str, Any]:
    shares = {
        share.truth: {"share": asdict(share.share), "alone": asdict(share.alone)}
        for share in found.shares
    }
    rest = {"rest": asdict(found.rest), "rest_with_exact_normals": asdict(found.exact)}
    return {"metric": found.metric.name, "error": asdict(found.error), "shares": shares} | rest


def _check(check: RenderCheck) -> dict[str, Any]:
    return {
        "scene": check.scene,
        "what": check.what,
        "error": check.error,
        "limit": check.limit,
        "passed": check.passed,
    }


def _scene(scene: SceneResult) -> dict[str, Any]:
    facts = {name: value for name, value in asdict(scene.facts).items() if name != "folder"}
    stages = {
        result.stage: {"scores": _scores(result.scores), "seconds": round(result.seconds, 4)}
        for result in scene.stages
    }
    return {
        "facts": facts,
        "refused": scene.refused,
        "stages": stages,
        "chain": None if scene.chain is None else _chain(scene),
    }


def _chain(scene: SceneResult) -> dict[str, Any]:
    chain = scene.chain
    assert chain is not None
    swapped = {
        "+".join(truths) or "nothing": _scores(scores)
        for truths, scores in zip(COMBINATIONS, chain.swapped, strict=True)
    }
    extra = {"untouched": _scores(chain.untouched), "exact_normals": _scores(chain.exact_normals)}
    return {"swapped": swapped, **extra, "light_fit_residual": chain.light_fit_residual}


def _scores(scores: Any) -> dict[str, Any]:
    if isinstance(scores, Variants):
        return {name: _scores(own) for name, own in scores.items()}
    average = getattr(scores, "average", None)
    return asdict(scores) | ({} if average is None else {"average": average})
