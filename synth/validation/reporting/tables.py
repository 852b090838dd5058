"""Tables of the report, independent of HTML or Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..checks.render_checks import RenderCheck
from ..measurement.bounds import Verdict
from ..measurement.figures import Figure
from ..measurement.slices import EVERYTHING
from ..measurement.substitution import Budget
from .formatting import percent, with_interval

TRUTH_TITLES = {"diffuse": "separation", "shape": "shape", "light": "light"}
REMAINING = "remaining with all ground truths"


@dataclass(frozen=True)
class TextTable:
    """A table of formatted cells.

    Attributes
    ----------
    heading : tuple of str
        Column titles.
    rows : tuple of tuple of str
        The cells.
    text_columns : int
        Number of text columns, from the left; the others are numeric.
    """

    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: int = 1


def budget_table(budgets: Sequence[Budget], *, details: bool = False) -> TextTable:
    """Tabulate error budgets, one row per metric.

    Parameters
    ----------
    budgets : sequence of Budget
        The budgets.
    details : bool, optional
        Add the remaining error with exact normals, and the error ratio under each single ground
        truth.

    Returns
    -------
    TextTable
        The table.
    """
    titles = TRUTH_TITLES.values()
    heading = ["error", "of the chain", *(f"share of {title}" for title in titles), REMAINING]
    if details:
        heading += ["remaining with exact normals too"]
        heading += [f"ratio with true {name}" for name in TRUTH_TITLES]
    rows = []
    for found in budgets:
        shares = {share.truth: share for share in found.shares}
        row = [found.metric.title, with_interval(found.error)]
        row += [percent(shares[name].share) if name in shares else "" for name in TRUTH_TITLES]
        row += [percent(found.rest)]
        if details:
            row += [percent(found.exact)]
            row += [
                with_interval(shares[name].alone) if name in shares else "" for name in TRUTH_TITLES
            ]
        rows.append(tuple(row))
    return TextTable(tuple(heading), tuple(rows))


def stage_table(figures: Sequence[Figure], *, details: bool = False) -> TextTable:
    """Tabulate a stage's metrics over all scenes.

    Parameters
    ----------
    figures : sequence of Figure
        The stage's figures over all slices.
    details : bool, optional
        Add the kind of mean.

    Returns
    -------
    TextTable
        The table.
    """
    kind = ("mean over scenes",) if details else ()
    rows = []
    for figure in (f for f in figures if f.group.kind == EVERYTHING):
        mean = ("geometric" if figure.metric.geometric else "arithmetic",) if details else ()
        scenes = str(figure.interval.scenes)
        cells = (figure.metric.title, with_interval(figure.interval), figure.metric.unit)
        rows.append((*cells, *mean, scenes))
    return TextTable(("metric", "mean [95 % interval]", "unit", *kind, "scenes"), tuple(rows))


def slice_tables(figures: Sequence[Figure]) -> tuple[tuple[str, TextTable], ...]:
    """Tabulate a stage's metrics over each kind of slice.

    Parameters
    ----------
    figures : sequence of Figure
        The stage's figures over all slices.

    Returns
    -------
    tuple of (str, TextTable)
        Kind and table, one row per slice.
    """
    names = [f.metric.title for f in figures if f.group.kind == EVERYTHING]
    kinds = dict.fromkeys(f.group.kind for f in figures if f.group.kind != EVERYTHING)
    tables = []
    for kind in kinds:
        of_kind = [f for f in figures if f.group.kind == kind]
        rows = []
        for value in dict.fromkeys(f.group.value for f in of_kind):
            own = {f.metric.title: f for f in of_kind if f.group.value == value}
            scenes = len(next(iter(own.values())).group.members)
            cells = (with_interval(own[name].interval) if name in own else "" for name in names)
            rows.append((value, str(scenes), *cells))
        tables.append((kind, TextTable((kind, "scenes", *names), tuple(rows))))
    return tuple(tables)


def verdict_table(verdicts: Sequence[Verdict], checks: Sequence[RenderCheck]) -> TextTable:
    """Tabulate bounds and checks, violated bounds first.

    Parameters
    ----------
    verdicts : sequence of Verdict
        Results of the bounds.
    checks : sequence of RenderCheck
        Results of the data set's checks.

    Returns
    -------
    TextTable
        The table.
    """
    ordered = sorted(verdicts, key=lambda verdict: not verdict.broken)
    rows = [("violated" if verdict.broken else "met", verdict.text) for verdict in ordered]
    rows += [("passed" if check.passed else "failed", check.text) for check in checks]
    return TextTable(("verdict", "bound or check"), tuple(rows), text_columns=2)
