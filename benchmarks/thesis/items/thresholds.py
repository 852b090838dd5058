"""Tables 4.1 to 4.4: exact thresholds of nine images, and repeated runs of three optimisers.

Problem: Otsu's criterion for K = 3, 4 and 5 thresholds. The exact optimum comes from dynamic
programming, checked against all candidates for K = 3. PSO, clonal selection (ClonalG) and its
chaotic form (CS) have equal budgets of evaluations.

Citation: those of `isc_core.thresholding` and of `threshold_runs`.

Limits: other images than in the thesis; where the thesis leaves operators of ClonalG and CS open,
they are this project's.
"""

import time
from collections import Counter
from dataclasses import replace
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from isc_core.thresholding import OtsuObjective, exact

from ...separation.thresholding import COUNTS, HIT
from ..drawing.style import OKABE_ITO, figure, legend
from ..measuring.context import Context
from ..measuring.threshold_runs import (
    COMPARED,
    EVALUATIONS,
    SEARCHES,
    ThresholdRuns,
    count_iterations,
    holm_correction,
    image_names,
    image_objective,
    rank_sum_test,
    run_searches,
    search_times,
    wilson_interval,
)
from ..report.claims import CHAOS_FINDS_OPTIMUM, CHAOS_HELPS
from ..report.item import Cell, ClaimVerdict, Holds, ItemContent, ItemTable, ThesisItem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEVELS = 256
_REPEATS = 5  # of which the fastest counts
_SIGNIFICANT = 0.05
_MARKS = ("o", "s", "D", "^")


def exhaustive_search(of: OtsuObjective) -> tuple[tuple[int, int, int], float]:
    """Find the best three thresholds among all 2.8 million sets.

    Parameters
    ----------
    of : OtsuObjective
        The objective.

    Returns
    -------
    thresholds : (int, int, int)
        The best set.
    value : float
        Its objective.
    """
    best, where = -np.inf, (0, 0, 0)
    for first in range(_LEVELS - 2):
        # All second and third thresholds at once: rows are ends of the second class, columns of the
        # third.
        rest = of.terms[first + 1, :, None] + of.terms + of.terms[:, _LEVELS][None]
        second, third = np.unravel_index(int(np.argmax(rest)), rest.shape)
        value = float(of.terms[0, first + 1] + rest[second, third])
        if value > best:
            best, where = value, (first, int(second) - 1, int(third) - 1)
    return where, best


def ground_truth(context: Context) -> ItemContent:
    """Make table 4.1.

    Parameters
    ----------
    context : Context
        The run.

    Returns
    -------
    ItemContent
        The exact thresholds by Otsu's criterion.
    """
    rows, checks = [], []
    names = image_names(context)
    for number, name in enumerate(names):
        context.monitor.report(f"exact thresholds of {name}", number / len(names))
        of = image_objective(name)
        begin = time.process_time()
        one_by_one = exhaustive_search(of)
        seconds = time.process_time() - begin
        for count in COUNTS:
            found = exact(of, count)
            total = float(of.terms[np.arange(_LEVELS), np.arange(1, _LEVELS + 1)].sum())
            rows.append(
                (
                    name,
                    count,
                    _listed(found.thresholds),
                    found.value,
                    100 * found.value / total,
                    _milliseconds(of, count),
                )
            )
        agrees = abs(one_by_one[1] - exact(of, 3).value) <= HIT * one_by_one[1]
        checks.append(
            (name, _listed(one_by_one[0]), one_by_one[1], "yes" if agrees else "NO", 1e3 * seconds)
        )
    header = ("image", "K", "thresholds", "objective", "% of the variance", "ms")
    caption = f"Three thresholds by testing all {comb(_LEVELS, 3):,} sets"
    tables = (
        ItemTable(header, tuple(rows), "Exact optimum of Otsu's criterion by dynamic programming."),
        ItemTable(
            ("image", "thresholds", "objective", "same optimum", "ms"), tuple(checks), caption
        ),
    )
    made, axes = figure(1, 1, height=2.8)
    for count, colour, mark in zip(COUNTS, OKABE_ITO, _MARKS, strict=False):
        shares = [row[4] for row in rows if row[1] == count]
        axes[0, 0].plot(
            names,
            shares,
            color=colour,
            marker=mark,
            markersize=4,
            linestyle="none",
            label=f"K = {count}",
        )
    axes[0, 0].set_ylabel("variance between classes, % of all")
    legend(axes[0, 0])
    text = (
        "For K = 4 and 5 there are 175 million and 8.8 thousand million sets of "
        "thresholds. The criterion is a sum over classes, so that dynamic programming "
        "finds the same optimum in about a millisecond."
    )
    return ItemContent(tables, (made,), text)


def objectives(context: Context) -> ItemContent:
    """Make table 4.2.

    Parameters
    ----------
    context : Context
        The run.

    Returns
    -------
    ItemContent
        The objectives that the searches reach.
    """
    found = run_searches(context, tuple(SEARCHES))
    names = image_names(context)
    shares = tuple(_shares(found, search, names) for search in SEARCHES)
    p_swarm = holm_correction(
        [
            rank_sum_test(found["CS", i, k].values, found["PSO", i, k].values)[1]
            for i in names
            for k in COUNTS
        ]
    )
    p_clonal = holm_correction(
        [
            rank_sum_test(found["CS", i, k].values, found["ClonalG", i, k].values)[1]
            for i in names
            for k in COUNTS
        ]
    )
    rows = []
    for place, (name, count) in enumerate((i, k) for i in names for k in COUNTS):
        cells: list[Cell] = [name, count, f"{exact(image_objective(name), count).value:.3f}"]
        for search in COMPARED:
            values = found[search, name, count].values
            cells += [f"{values.mean():.3f}", f"{values.std(ddof=1):.4f}"]
        rows.append((*cells, float(p_swarm[place]), float(p_clonal[place])))
    header = (
        "image",
        "K",
        "optimum",
        *(f"{s}: {w}" for s in COMPARED for w in ("mean", "deviation")),
        "p, CS and PSO",
        "p, CS and ClonalG",
    )
    runs = len(next(iter(found.values())).values)
    tables = (
        ItemTable(
            ("search", *(f"K = {k}" for k in COUNTS), "all", "95 % interval"),
            shares,
            f"Share of {runs} runs per image that reach the optimum.",
        ),
        ItemTable(
            header,
            tuple(rows),
            f"Objective over {runs} runs; p: rank-sum test, corrected for {len(rows)} cases "
            "(Holm).",
        ),
    )
    return ItemContent(
        tables, (_hit_figure(found, names),), _OBJECTIVES_TEXT, _objective_verdicts(found, names)
    )


_OBJECTIVES_TEXT = (
    "*CS, one orbit* uses the consecutive values of a single chaotic orbit, the "
    "literal reading of the method: consecutive numbers are dependent, some moves "
    "never occur, and runs stagnate. *CS* takes consecutive numbers from many "
    "orbits."
)


def thresholds(context: Context) -> ItemContent:
    """Make table 4.3.

    Parameters
    ----------
    context : Context
        The run.

    Returns
    -------
    ItemContent
        The thresholds that the searches find most often.
    """
    found = run_searches(context, COMPARED)
    names, rows = image_names(context), []
    for name in names:
        for count in COUNTS:
            cells: list[Cell] = [
                name,
                count,
                _listed(exact(image_objective(name), count).thresholds),
            ]
            for search in COMPARED:
                usual, many = Counter(
                    map(tuple, found[search, name, count].thresholds.tolist())
                ).most_common(1)[0]
                share = 100 * many / len(found[search, name, count].values)
                cells.append(f"{_listed(usual)} ({share:.0f} %)")
            rows.append(tuple(cells))
    header = ("image", "K", "exact", *(f"{search} (share of runs)" for search in COMPARED))
    made, axes = figure(1, len(COUNTS), height=0.9 + 0.35 * len(names), sharey=True)
    for place, count in zip(axes[0], COUNTS, strict=True):
        for line, name in enumerate(names):
            for step, (search, colour) in enumerate(zip(COMPARED, OKABE_ITO, strict=False)):
                levels = found[search, name, count].thresholds
                label = search if line == 0 else None
                place.plot(
                    levels.ravel(),
                    np.full(levels.size, line + 0.22 * (step - 1)),
                    "|",
                    color=colour,
                    markersize=5,
                    label=label,
                )
        place.set(
            title=f"K = {count}",
            xlabel="level",
            xlim=(0, 255),
            yticks=range(len(names)),
            yticklabels=names,
        )
    axes[0, 0].invert_yaxis()
    made.legend(
        *axes[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=3,
        frameon=False,
        fontsize=7,
    )
    text = "Each stroke is a threshold of one run: where a search is stable, its strokes coincide."
    return ItemContent(
        (ItemTable(header, tuple(rows), "The most frequent thresholds of each search."),),
        (made,),
        text,
    )


def times(context: Context) -> ItemContent:
    """Make table 4.4.

    Parameters
    ----------
    context : Context
        The run.

    Returns
    -------
    ItemContent
        The time of the searches and their iterations to the optimum.
    """
    found = run_searches(replace(context, monitor=context.monitor.part(0.0, 0.5)), COMPARED)
    names = image_names(context)
    cases = [(name, count) for name in names for count in COUNTS]
    p_values = holm_correction(
        [
            rank_sum_test(found["CS", *case].needed, found["ClonalG", *case].needed)[1]
            for case in cases
        ]
    )
    rows: list[tuple[Cell, ...]] = []
    for case, p in zip(cases, p_values, strict=True):
        cells: list[Cell] = [*case]
        for search in COMPARED:
            context.monitor.report(
                f"timing {search} on {case[0]}", 0.5 + 0.5 * len(rows) / len(cases)
            )
            cells += [
                float(np.median(search_times(context, search, *case))),
                _median_iterations(search, found[search, *case]),
            ]
        rows.append((*cells, float(p)))
    header = (
        "image",
        "K",
        *(f"{s}: {w}" for s in COMPARED for w in ("ms per run", "iterations to the optimum")),
        "p, CS and ClonalG",
    )
    caption = (
        "Median over runs; iterations of successful runs. p: rank-sum test of the evaluations "
        "needed, corrected (Holm)."
    )
    made, axes = figure(1, len(COUNTS), height=2.6, sharey=True)
    for place, count in zip(axes[0], COUNTS, strict=True):
        for search, colour in zip(COMPARED, OKABE_ITO, strict=False):
            needed = np.sort(np.concatenate([found[search, name, count].needed for name in names]))
            reached = needed[np.isfinite(needed)]
            shares = 100 * np.append(np.arange(1, len(reached) + 1), len(reached)) / len(needed)
            place.step(
                np.append(reached, EVALUATIONS) / 1e3,
                shares,
                where="post",
                color=colour,
                label=search,
            )
        place.set(
            title=f"K = {count}",
            xlabel="evaluations, thousands",
            xlim=(0, EVALUATIONS / 1e3),
            ylim=(0, 102),
        )
    axes[0, 0].set_ylabel("runs at the optimum, %")
    legend(axes[0, -1], "lower right")
    return ItemContent(
        (ItemTable(header, tuple(rows), caption),),
        (made,),
        _TIMES_TEXT,
        (_speed_verdict(found, cases, p_values),),
    )


_TIMES_TEXT = (
    "An iteration is a generation of 255 evaluations for ClonalG and CS, and a "
    "step of 40 for PSO. Times are processor times for the whole budget of 20,000 "
    "evaluations. The exact search takes a millisecond (table 4.1)."
)


def _objective_verdicts(
    found: dict[tuple[str, str, int], ThresholdRuns], names: tuple[str, ...]
) -> tuple[ClaimVerdict, ...]:
    hits = {
        search: sum(found[search, i, k].hits for i in names for k in COUNTS) for search in SEARCHES
    }
    total = sum(len(found["CS", i, k].values) for i in names for k in COUNTS)
    low, _ = wilson_interval(hits["CS"], total)
    share = {search: f"{100 * many / total:.1f} %" for search, many in hits.items()}
    best = Holds.NO
    if hits["CS"] > 0.95 * total:
        best = Holds.YES if hits["CS"] == total else Holds.PARTLY
    return (
        ClaimVerdict(
            CHAOS_FINDS_OPTIMUM,
            f"{hits['CS']} of {total} runs ({share['CS']}, at least {100 * low:.1f} % at 95 %).",
            best,
        ),
        ClaimVerdict(
            CHAOS_HELPS,
            f"CS reaches the optimum in {share['CS']} of runs, ClonalG in {share['ClonalG']}, "
            f"PSO in {share['PSO']}; CS on one orbit in {share['CS, one orbit']}.",
            *_more_often(hits, total),
        ),
    )


def _more_often(hits: dict[str, int], total: int) -> tuple[Holds, str]:
    """Judge by the intervals of the shares whether CS succeeds more often than the others."""
    low, high = zip(*(wilson_interval(hits[search], total) for search in COMPARED), strict=True)
    swarm, plain, chaotic = range(len(COMPARED))
    over = {place: low[chaotic] > high[place] for place in (swarm, plain)}
    if all(over.values()):
        return Holds.YES, ""
    if over[swarm] and low[plain] > high[swarm]:
        return Holds.PARTLY, (
            "It beats the swarm, but so does plain ClonalG: the operators decide, not the source "
            "of numbers."
        )
    if any(over.values()):
        better, other = ("PSO", "ClonalG") if over[swarm] else ("ClonalG", "PSO")
        return Holds.PARTLY, f"It beats {better}, but not {other}."
    if any(hits["CS"] > hits[search] for search in ("PSO", "ClonalG")):
        return Holds.UNDETERMINED, "Too few runs: the intervals of the shares overlap."
    return Holds.NO, "It succeeds no more often than the others."


def _speed_verdict(
    found: dict[tuple[str, str, int], ThresholdRuns],
    cases: list[tuple[str, int]],
    p_values: np.ndarray,
) -> ClaimVerdict:
    needed = {
        search: np.concatenate([found[search, *case].needed for case in cases])
        for search in COMPARED
    }
    tests = {other: rank_sum_test(needed["CS"], needed[other]) for other in ("ClonalG", "PSO")}
    faster = [p < _SIGNIFICANT and more < 0.5 for more, p in tests.values()]
    different = int((p_values < _SIGNIFICANT).sum())
    pairs = " and ".join(
        f"than {other} in {100 * more:.0f} % (p = {p:.2g})" for other, (more, p) in tests.items()
    )
    return ClaimVerdict(
        CHAOS_HELPS,
        f"CS needs {_median(needed['CS'])} evaluations, ClonalG {_median(needed['ClonalG'])}, PSO "
        f"{_median(needed['PSO'])} in successful runs (medians). Of pairs of runs, CS needs more "
        f"{pairs}; {different} of {len(cases)} cases of CS and ClonalG differ.",
        Holds.YES if all(faster) else Holds.PARTLY if any(faster) else Holds.NO,
        ""
        if all(faster)
        else f"{_speed_words('ClonalG', *tests['ClonalG'])} {_speed_words('PSO', *tests['PSO'])}",
    )


def _speed_words(other: str, more: float, p: float) -> str:
    """Say what the test of CS and another search shows."""
    if p >= _SIGNIFICANT:
        return f"The speed of CS and {other} cannot be told apart."
    return f"CS is {'slower' if more > 0.5 else 'faster'} than {other}."


def _median(needed: np.ndarray) -> str:
    """Format the median over the successful runs."""
    hit = needed[np.isfinite(needed)]
    return f"{np.median(hit):.0f}" if len(hit) else "(never successful)"


def _shares(
    found: dict[tuple[str, str, int], ThresholdRuns], search: str, names: tuple[str, ...]
) -> tuple[Cell, ...]:
    """Return a row: successful runs by K, in total, and the interval, per cent."""
    hits = [sum(found[search, name, count].hits for name in names) for count in COUNTS]
    total = len(names) * len(found[search, names[0], COUNTS[0]].values)
    low, high = wilson_interval(sum(hits), total * len(COUNTS))
    cells = [f"{100 * many / total:.1f} %" for many in hits]
    return (
        search,
        *cells,
        f"{100 * sum(hits) / (total * len(COUNTS)):.1f} %",
        f"{100 * low:.1f} to {100 * high:.1f} %",
    )


def _hit_figure(
    found: dict[tuple[str, str, int], ThresholdRuns], names: tuple[str, ...]
) -> "Figure":
    """Draw the share of successful runs by image and K."""
    made, axes = figure(1, len(COUNTS), height=0.9 + 0.25 * len(names), sharey=True)
    for place, count in zip(axes[0], COUNTS, strict=True):
        for step, (search, colour, mark) in enumerate(
            zip(SEARCHES, OKABE_ITO, _MARKS, strict=False)
        ):
            shares = [
                100 * found[search, name, count].hits / len(found[search, name, count].values)
                for name in names
            ]
            lines = np.arange(len(names)) + 0.18 * (step - 1.5)
            place.plot(
                shares,
                lines,
                marker=mark,
                color=colour,
                linestyle="none",
                markersize=3.5,
                label=search,
                clip_on=False,
            )
        place.set(
            title=f"K = {count}",
            xlabel="runs that reach the optimum, %",
            xlim=(0, 102),
            yticks=range(len(names)),
            yticklabels=names,
        )
        place.grid(axis="x", linewidth=0.4, color="0.85")
    axes[0, 0].invert_yaxis()
    made.legend(
        *axes[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4,
        frameon=False,
        fontsize=7,
    )
    return made


def _median_iterations(search: str, runs: ThresholdRuns) -> str:
    hit = runs.needed[np.isfinite(runs.needed)]
    return f"{np.median(count_iterations(search, hit)):.0f}" if len(hit) else "never"


def _milliseconds(of: OtsuObjective, count: int) -> float:
    """Time the exact search, the fastest of a few runs."""
    taken = []
    for _ in range(_REPEATS):
        begin = time.process_time()
        exact(of, count)
        taken.append(time.process_time() - begin)
    return 1e3 * min(taken)


def _listed(found: "np.ndarray | tuple[int, ...]") -> str:
    return " ".join(str(int(level)) for level in found)


ITEMS: tuple[ThesisItem, ...] = (
    ThesisItem("table", "4.1", "Exact Otsu thresholds of nine images", ground_truth),
    ThesisItem(
        "table",
        "4.2",
        "Objective of PSO, ClonalG and CS: mean and deviation over repeated runs",
        objectives,
    ),
    ThesisItem("table", "4.3", "Thresholds of PSO, ClonalG and CS", thresholds),
    ThesisItem("table", "4.4", "Time and iterations of PSO, ClonalG and CS", times),
)
