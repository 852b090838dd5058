"""Tables 4.5 to 4.10: highlights found by multilevel thresholds and painted over, the thresholds
searched by PSO, ClonalG and CS.

For each kind of images, with significant specularity, synthetic, and without, an accuracy and a
speed table. "As published": three thresholds, pixels painted over in colour; "improved": ours, one
threshold, white light taken off. `exact search` finds the thresholds without any random number, and
`doing nothing` leaves the photo as it is: what does not beat that does harm.

Citation: H. Akbar, thesis (2016); see `isc_core.separation.chaotic_segmentation` and
`isc_core.thresholding`.

Limits: which images the thesis' own tables are made on is not known beyond their kind. Seconds
depend on what else the machine does.
"""

import functools
from collections.abc import Callable

from ..measuring.context import Context
from ..measuring.separation_scores import NOTHING, SEGMENTATION, SeparatorSetting
from ..report.claims import CHAOS_HELPS
from ..report.comparing import paired_ratio
from ..report.item import ClaimVerdict, ItemContent, ItemTable, ThesisItem
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
_SETTINGS = {"paper": "as published", "improved": "improved"}
WAYS = tuple(
    SeparatorSetting(f"{label}, {words}", SEGMENTATION, variant, (("optimiser", optimiser),))
    for variant, words in _SETTINGS.items()
    for label, optimiser in OPTIMISERS.items()
)
_CHAOS, _RIVALS = "CS, as published", ("PSO, as published", "ClonalG, as published")


def _accuracy(kind: str, context: Context) -> ItemContent:
    runs = _runs(kind, context)
    tables = (
        accuracy_table(runs, kind, DIFFUSE, context.seed, _chaos_of, "CS"),
        subject_table(runs, kind, DIFFUSE, _chaos_of, "CS"),
    )
    return ItemContent(
        (tables[0], hit_table(runs), tables[1]),
        text=_ACCURACY,
        verdicts=(verdict(runs, "mse", "MSE", _SAME, context.seed),),
    )


def hit_table(runs: RunScores) -> ItemTable:
    """How often each search marked the very pixels that the exact one marks."""
    lines = []
    for label, of_subjects in runs.items():
        ends = [
            run.exact for found in of_subjects.values() for run in found if run.exact is not None
        ]
        if ends:
            lines.append((label, len(ends), f"{100 * sum(ends) / len(ends):.0f} %"))
    return ItemTable(
        ("method", "runs", "as the exact search"),
        tuple(lines),
        "Runs that marked the pixels which the exact search marks",
    )


def _speed(kind: str, context: Context) -> ItemContent:
    runs = _runs(kind, context)
    return ItemContent(
        (speed_table(runs, _chaos_of, context.seed, "CS"),),
        text=_SPEED,
        verdicts=(verdict(runs, "search", "search time", _DEAR, context.seed),),
    )


def _runs(kind: str, context: Context) -> RunScores:
    return score_settings(context, kind, WAYS, QUICK_RUNS if context.quick else RUNS)


def verdict(runs: RunScores, name: str, what: str, why: str, seed: int) -> ClaimVerdict:
    """Whether CS has less of a score, `what`, than both rivals;

    `why`: what explains that it has not.
    """
    found = [
        paired_ratio(mean_scores(runs[_CHAOS], name), mean_scores(runs[label], name), seed)
        for label in _RIVALS
    ]
    here = f"{what} of CS over that of " + "; of ".join(
        f"{label.split(',')[0]} {in_words(each)}"
        for label, each in zip(_RIVALS, found, strict=True)
    )
    if any(each is None for each in found):
        return ClaimVerdict(
            CHAOS_HELPS, here, "cannot be told", "fewer than two subjects with a value above 0"
        )
    surely = [each is not None and each.high < 1 for each in found]
    return ClaimVerdict(
        CHAOS_HELPS,
        here,
        "yes" if all(surely) else "partly" if any(surely) else "no",
        "" if all(surely) else why,
    )


def _chaos_of(label: str) -> str | None:
    """CS in the setting of a way; None for doing nothing."""
    return None if label == NOTHING.label else f"CS,{label.partition(',')[2]}"


_SAME = "where the searches find the same thresholds, the layers differ by the random numbers of the patches at most"
_DEAR = "all searches spend the same budget of evaluations, and a chaotic number costs no less than a pseudo-random one"
_ACCURACY = (
    "The searches differ in how they come to the thresholds, not in what the thresholds are for: where they find the same ones, the "
    "accuracy is the same, and the second table says how often. As published the method has no way to say that there is no highlight, so "
    "that it repaints bright paint too; `doing nothing` shows how much harm that is. The rank-sum tests compare runs with different seeds "
    "on one subject; the intervals resample subjects."
)
_SPEED = (
    "Search: finding the thresholds, 20,000 evaluations at most, and marking the pixels above them, in processor time. Whole: the search, "
    "matching and filling. Seconds are worth no more than the quiet of the machine they were taken on."
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
