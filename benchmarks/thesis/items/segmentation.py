"""Tables 4.5 to 4.10: highlights detected by multilevel thresholds and inpainted.

Problem: the thresholds are searched by PSO, ClonalG and CS. For each kind of images (significant
specularity, synthetic, without specularity) one table of accuracy and one of speed. "As published":
three thresholds, pixels inpainted in colour; "improved": this project's, one threshold, only white
light removed. `exact search` finds the thresholds without random numbers; `doing nothing` leaves
the photo as it is, and a method that does not beat it is harmful.

Citation: H. Akbar, thesis (2016); see `isc_core.separation.chaotic_segmentation` and
`isc_core.thresholding`.

Limits: of the images behind the thesis' own tables, only the kind is known. Seconds depend on the
load of the machine.
"""

import functools
from collections.abc import Callable

from ..measuring.context import Context
from ..measuring.separation_scores import NOTHING, SEGMENTATION, SeparatorSetting
from ..report.claims import CHAOS_HELPS
from ..report.comparing import format_ratio, paired_ratio
from ..report.item import ClaimVerdict, Holds, ItemContent, ItemTable, ThesisItem
from ..report.layer_tables import (
    DIFFUSE,
    KINDS,
    RunScores,
    accuracy_table,
    mean_scores,
    score_settings,
    speed_table,
    subject_table,
)

OPTIMISERS = {
    "PSO": "particle_swarm",
    "ClonalG": "clonal_selection",
    "CS": "chaotic_clonal",
    "exact search": "exact",
}
RUNS, QUICK_RUNS = 5, 2
_VARIANTS = {"paper": "as published", "improved": "improved"}
SETTINGS = tuple(
    SeparatorSetting(f"{label}, {words}", SEGMENTATION, variant, (("optimiser", optimiser),))
    for variant, words in _VARIANTS.items()
    for label, optimiser in OPTIMISERS.items()
)
_CHAOS, _COMPARED = "CS, as published", ("PSO, as published", "ClonalG, as published")


def _accuracy(kind: str, context: Context) -> ItemContent:
    runs = _scores(kind, context)
    summary = accuracy_table(runs, kind, DIFFUSE, context.seed, _chaos_of, "CS")
    by_subject = subject_table(runs, kind, DIFFUSE, _chaos_of, "CS")
    return ItemContent(
        (summary, hit_table(runs), by_subject),
        text=_ACCURACY_TEXT,
        verdicts=(judge_score(runs, "mse", "MSE", _EQUAL_THRESHOLDS, context.seed),),
    )


def hit_table(runs: RunScores) -> ItemTable:
    """Count the runs that mark exactly the pixels of the exact search.

    Parameters
    ----------
    runs : RunScores
        Scores of all settings.

    Returns
    -------
    ItemTable
        One row per setting with a threshold search.
    """
    rows = []
    for label, subjects in runs.items():
        hits = [run.exact for each in subjects.values() for run in each if run.exact is not None]
        if hits:
            rows.append((label, len(hits), f"{100 * sum(hits) / len(hits):.0f} %"))
    return ItemTable(
        ("method", "runs", "same as the exact search"),
        tuple(rows),
        "Runs that mark exactly the pixels of the exact search",
    )


def _speed(kind: str, context: Context) -> ItemContent:
    runs = _scores(kind, context)
    return ItemContent(
        (speed_table(runs, _chaos_of, context.seed, "CS"),),
        text=_SPEED_TEXT,
        verdicts=(judge_score(runs, "search", "search time", _EQUAL_BUDGET, context.seed),),
    )


def _scores(kind: str, context: Context) -> RunScores:
    return score_settings(context, kind, SETTINGS, QUICK_RUNS if context.quick else RUNS)


def judge_score(runs: RunScores, field: str, what: str, why: str, seed: int) -> ClaimVerdict:
    """Judge whether CS has a lower score than both PSO and ClonalG.

    Parameters
    ----------
    runs : RunScores
        Scores of all settings.
    field : str
        A field of `SeparationScores`.
    what : str
        Name of the score.
    why : str
        Explanation if CS does not have a lower score.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    ClaimVerdict
        YES if lower than both with certainty, PARTLY if lower than one.
    """
    ours = mean_scores(runs[_CHAOS], field)
    ratios = [paired_ratio(ours, mean_scores(runs[label], field), seed) for label in _COMPARED]
    here = f"{what}, ratio of CS to " + "; to ".join(
        f"{label.split(',')[0]} {format_ratio(ratio)}"
        for label, ratio in zip(_COMPARED, ratios, strict=True)
    )
    if any(ratio is None for ratio in ratios):
        reason = "fewer than two subjects with a value above 0"
        return ClaimVerdict(CHAOS_HELPS, here, Holds.UNDETERMINED, reason)
    lower = [ratio is not None and ratio.high < 1 for ratio in ratios]
    if all(lower):
        return ClaimVerdict(CHAOS_HELPS, here, Holds.YES)
    return ClaimVerdict(CHAOS_HELPS, here, Holds.PARTLY if any(lower) else Holds.NO, why)


def _chaos_of(label: str) -> str | None:
    """Return CS in the same variant; None for doing nothing."""
    return None if label == NOTHING.label else f"CS,{label.partition(',')[2]}"


_EQUAL_THRESHOLDS = (
    "where the searches find the same thresholds, the layers differ at most by the random numbers "
    "of the patches"
)
_EQUAL_BUDGET = (
    "all searches spend the same budget of evaluations, and a chaotic number costs no less than a "
    "pseudo-random one"
)
_ACCURACY_TEXT = (
    "The searches differ only in how they reach the thresholds. Where they find the same ones, the "
    "accuracy is the same; the second table counts how often. As published, the method cannot "
    "report that there is no highlight, so that it also repaints bright surfaces; `doing nothing` "
    "shows how harmful that is. The rank-sum tests compare runs with different seeds on one "
    "subject; the intervals resample subjects."
)
_SPEED_TEXT = (
    "Search: processor time to find the thresholds (at most 20,000 evaluations) and to mark the "
    "pixels above them. Total: search, patch matching and filling. Seconds depend on the load of "
    "the machine."
)
_PARTS: tuple[tuple[str, Callable[[str, Context], ItemContent]], ...] = (
    ("accuracy", _accuracy),
    ("speed", _speed),
)

ITEMS: tuple[ThesisItem, ...] = tuple(
    ThesisItem(
        "table",
        f"4.{5 + 2 * row + column}",
        f"Segmentation by PSO, ClonalG and CS with inpainting, {words}: {what}",
        functools.partial(make, kind),
    )
    for row, (kind, words) in enumerate(KINDS.items())
    for column, (what, make) in enumerate(_PARTS)
)
