"""The findings of a validation as sentences: the verdict, and the largest error sources."""

from collections.abc import Sequence

from ..measurement.bootstrap import Interval
from ..measurement.figures import CHAIN, Figure
from ..measurement.slices import EVERYTHING
from ..measurement.substitution import Budget
from ..stages.models import NAME as MODELS
from .formatting import percent, with_interval
from .model_tables import model_findings
from .outcome import ValidationOutcome

CHAIN_TITLE = "Whole chain, from the photo"
_TRUTHS = {"diffuse": "diffuse image", "shape": "shape", "light": "light"}
_FEWEST = 5  # scenes of a slice that is compared with others


def verdict_line(outcome: ValidationOutcome) -> str:
    """Return the verdict with the number of bounds and checks.

    Parameters
    ----------
    outcome : ValidationOutcome
        The validation.

    Returns
    -------
    str
        A sentence that begins with "Accepted" or "Rejected".
    """
    broken = sum(verdict.broken for verdict in outcome.verdicts)
    failed = sum(not check.passed for check in outcome.checks)
    if outcome.failures:
        return (
            f"Rejected: {broken} of {len(outcome.verdicts)} bounds violated, "
            f"{failed} of {len(outcome.checks)} data checks failed."
        )
    bounds = f"{len(outcome.verdicts)} bounds met" if outcome.verdicts else "no bounds given"
    return f"Accepted: {bounds}, {len(outcome.checks)} data checks passed."


def findings(outcome: ValidationOutcome) -> tuple[str, ...]:
    """Return the main findings, one sentence each, the largest error source first.

    Parameters
    ----------
    outcome : ValidationOutcome
        The validation.

    Returns
    -------
    tuple of str
        Plain text.
    """
    found: list[str] = []
    if outcome.budgets:
        found += _limits(outcome.budgets[0])
    for stage, figures in figures_by_stage(outcome.figures).items():
        first = next((f for f in figures if f.group.kind == EVERYTHING), None)
        if stage == MODELS:
            found += model_findings(outcome)
        elif first is not None and stage != CHAIN:
            mean = f"{first.metric.title} {with_interval(first.interval)}"
            found.append(f"{stage} alone: {mean} over {first.interval.scenes} scenes.")
        if extremes := _extreme_slices(figures):
            found.append(_slice_sentence(stage, *extremes))
    refused = [scene for scene in outcome.scenes if scene.refused]
    if refused:
        count = f"{len(refused)} of {len(outcome.scenes)}"
        found.append(f"{count} scenes could not be run. First: {refused[0].refused}.")
    return tuple(found)


def stage_title(stage: str) -> str:
    """Return the name of a stage or of the chain as headings show it.

    Parameters
    ----------
    stage : str
        Name of a stage, or `CHAIN`.

    Returns
    -------
    str
        The heading.
    """
    return CHAIN_TITLE if stage == CHAIN else stage


def figures_by_stage(figures: Sequence[Figure]) -> dict[str, list[Figure]]:
    """Group figures by stage.

    Parameters
    ----------
    figures : sequence of Figure
        The figures.

    Returns
    -------
    dict of str to list of Figure
        By stage; stages and figures keep their order.
    """
    stages = dict.fromkeys(f.stage for f in figures)
    return {stage: [f for f in figures if f.stage == stage] for stage in stages}


def _limits(found: Budget) -> list[str]:
    """The largest error sources of the chain, from its first budget."""
    ranked: list[tuple[float, str, Interval]] = [
        (s.share.value, f"the unknown {_TRUTHS[s.truth]}", s.share) for s in found.shares
    ]
    ranked.append((found.rest.value, "the model (it remains with all ground truths)", found.rest))
    ranked.sort(key=lambda entry: -entry[0])
    first, second = ranked[0], ranked[1]
    lines = [
        f"The largest error source of the chain is {first[1]}: {percent(first[2])} of the error of "
        f"{found.metric.title}. Second is {second[1]}: {percent(second[2])}."
    ]
    lines += [
        f"The true {_TRUTHS[share.truth]} increases this error ({percent(share.share)}): the error "
        "of the estimate compensates others."
        for share in found.shares
        if share.share.high is not None and share.share.high < 0
    ]
    return lines


def _slice_sentence(stage: str, best: Figure, worst: Figure) -> str:
    first, last = best.group, worst.group
    return (
        f"{stage_title(stage)} is worst for {last.kind} {last.value} ({worst.metric.title} "
        f"{with_interval(worst.interval)}) and best for {first.kind} {first.value} "
        f"({with_interval(best.interval)})."
    )


def _extreme_slices(figures: Sequence[Figure]) -> tuple[Figure, Figure] | None:
    """The best and the worst slice by a stage's first metric, among those with five scenes or more.

    None if their intervals overlap.
    """
    metric = figures[0].metric
    slices = [
        f
        for f in figures
        if f.metric.name == metric.name
        and f.group.kind not in (EVERYTHING, "split")
        and f.interval.scenes >= _FEWEST
    ]
    if len(slices) < 2:
        return None
    slices.sort(key=lambda f: f.interval.value, reverse=metric.larger_is_better)
    best, worst = slices[0], slices[-1]
    lower, upper = (worst, best) if metric.larger_is_better else (best, worst)
    low, high = upper.interval.low, lower.interval.high
    return (best, worst) if low is not None and high is not None and low > high else None
