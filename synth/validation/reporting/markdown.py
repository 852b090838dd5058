"""The summary of a validation: what limits the chain in words, and the tables that matter, as
Markdown small enough for the docs.
"""

from collections.abc import Sequence

from ..measurement.bootstrap import Interval
from ..measurement.figures import CHAIN, Figure
from ..measurement.slices import EVERYTHING
from ..measurement.substitution import Budget
from ..stages.models import NAME as MODELS
from ..stages.models import TITLE as MODELS_TITLE
from .model_tables import EXPLANATION, model_findings, model_tables
from .outcome import ValidationOutcome
from .words import percent, with_interval

TRUTH_TITLES = {"diffuse": "separation", "shape": "shape", "light": "light"}
_TRUTHS = {"diffuse": "diffuse image", "shape": "shape", "light": "light"}
MODEL_SLICES = (
    EVERYTHING,
    "material",
    "gloss",
    "albedo",
    "light",
)  # of models, in the summary; the report has all
CHAIN_TITLE = "The whole chain, from the photo"


def verdict_line(outcome: ValidationOutcome) -> str:
    """Accepted or rejected, and by how much was judged."""
    broken = sum(verdict.broken for verdict in outcome.verdicts)
    failed = sum(not check.passed for check in outcome.checks)
    if outcome.failures:
        return f"Rejected: {broken} of {len(outcome.verdicts)} bounds broken, {failed} of {len(outcome.checks)} checks of the data failed."
    bounds = f"{len(outcome.verdicts)} bounds" if outcome.verdicts else "no bounds were given"
    return f"Accepted: {bounds}; {len(outcome.checks)} checks of the data passed."


def findings(outcome: ValidationOutcome) -> tuple[str, ...]:
    """What the figures say, a sentence each, what limits the chain most first."""
    found = []
    if outcome.budgets:
        found += _limits(outcome.budgets[0])
    for stage, figures in _by_stage(outcome.figures).items():
        first = next((f for f in figures if f.group.kind == EVERYTHING), None)
        if stage == MODELS:
            found += model_findings(outcome)
        elif first is not None and stage != CHAIN:
            found.append(
                f"{stage} by itself: {first.metric.title} {with_interval(first.interval)} over {first.interval.scenes} scenes."
            )
        if worst := _worst_slice(figures):
            best, last = worst
            found.append(
                f"{_named(stage)} is worst on {last.group.kind} {last.group.value} ({last.metric.title} {with_interval(last.interval)}), "
                f"best on {best.group.kind} {best.group.value} ({with_interval(best.interval)})."
            )
    refused = [scene for scene in outcome.scenes if scene.refused]
    if refused:
        found.append(
            f"{len(refused)} of {len(outcome.scenes)} scenes could not be run; the first: {refused[0].refused}."
        )
    return tuple(found)


def summary(outcome: ValidationOutcome) -> str:
    """The whole summary."""
    lines = ["# Validation", "", verdict_line(outcome), ""]
    lines += [f"- {text}" for text in (*findings(outcome), *outcome.failures, *outcome.notes)]
    if outcome.budgets:
        lines += ["", "## Error budget", "", *budget_table(outcome.budgets)]
    for stage, figures in _by_stage(outcome.figures).items():
        if stage == MODELS:
            lines += _model_part(outcome)
            continue
        rows = [
            [f.metric.title, with_interval(f.interval), f.metric.unit, str(f.interval.scenes)]
            for f in figures
            if f.group.kind == "all"
        ]
        lines += [
            "",
            f"## {_named(stage)}",
            "",
            *_table(["figure", "mean [95 % interval]", "unit", "scenes"], rows),
        ]
    return "\n".join([*lines, "", f"Made by `{outcome.command}`.", ""])


def budget_table(budgets: Sequence[Budget]) -> list[str]:
    """The budgets as the lines of a Markdown table."""
    heading = [
        "error",
        "of the chain",
        *(f"share of {title}" for title in TRUTH_TITLES.values()),
        "left with all truths",
    ]
    rows = []
    for found in budgets:
        shares = {share.truth: percent(share.share) for share in found.shares}
        cells = [shares.get(truth, "") for truth in ("diffuse", "shape", "light")]
        rows.append([found.metric.title, with_interval(found.error), *cells, percent(found.rest)])
    return _table(heading, rows)


def _model_part(outcome: ValidationOutcome) -> list[str]:
    lines = ["", f"## {MODELS_TITLE}", "", EXPLANATION]
    tables = {table.kind: table for table in model_tables(outcome)}
    for kind in (kind for kind in MODEL_SLICES if kind in tables):
        lines += [
            "",
            *([] if kind == EVERYTHING else [f"By {kind}:", ""]),
            *_table(tables[kind].heading, tables[kind].rows),
        ]
    return lines


def _limits(found: Budget) -> list[str]:
    """What limits the chain most, from its first budget."""
    ranked: list[tuple[float, str, Interval]] = [
        (s.share.value, f"not knowing the {_TRUTHS[s.truth]}", s.share) for s in found.shares
    ]
    ranked.append(
        (found.rest.value, "what the model itself cannot say (left with all truths)", found.rest)
    )
    ranked.sort(key=lambda entry: -entry[0])
    first, second = ranked[0], ranked[1]
    lines = [
        f"What limits the chain most is {first[1]}: {percent(first[2])} of the error of {found.metric.title}; next is {second[1]}: "
        f"{percent(second[2])}."
    ]
    against = [
        share for share in found.shares if share.share.high is not None and share.share.high < 0
    ]
    lines += [
        f"Handing over the true {_TRUTHS[share.truth]} makes this error larger ({percent(share.share)}): its error makes up for others."
        for share in against
    ]
    return lines


def _named(stage: str) -> str:
    return CHAIN_TITLE if stage == CHAIN else stage


def _by_stage(figures: Sequence[Figure]) -> dict[str, list[Figure]]:
    return {
        stage: [f for f in figures if f.stage == stage]
        for stage in dict.fromkeys(f.stage for f in figures)
    }


def _worst_slice(figures: Sequence[Figure]) -> tuple[Figure, Figure] | None:
    """The best and the worst slice of a stage's first metric, of those with five scenes or more;

    None where intervals overlap.
    """
    name = figures[0].metric.name
    slices = [
        f
        for f in figures
        if f.metric.name == name
        and f.group.kind not in (EVERYTHING, "split")
        and f.interval.scenes >= 5
    ]
    if len(slices) < 2:
        return None
    slices.sort(key=lambda f: f.interval.value, reverse=figures[0].metric.larger_is_better)
    best, worst = slices[0], slices[-1]
    ordered = (best, worst) if not best.metric.larger_is_better else (worst, best)
    low, high = ordered[1].interval.low, ordered[0].interval.high
    return (best, worst) if low is not None and high is not None and low > high else None


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = ["| " + " | ".join(cells) + " |" for cells in (heading, *rows)]
    return [lines[0], "|" + "---|" * len(heading), *lines[1:]]
