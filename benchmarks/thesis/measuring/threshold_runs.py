"""Repeated threshold searches on nine images, shared by tables 4.1 to 4.4 and figures 4.1 to 4.9.

Problem: 50 runs of each optimiser on nine images with 3, 4 and 5 thresholds, each run with another
seed, all with the same budget of evaluations.

Equation: a share of k of n runs has the 95 % interval of Wilson, (p + z^2 / 2n ± z sqrt(p (1 - p) /
n + z^2 / 4n^2)) / (1 + z^2 / n); two samples of runs are compared by the rank-sum test, several
tests at once by Holm's correction.

Citation: E. B. Wilson (1927), doi:10.1080/01621459.1927.10502953; H. B. Mann, D. R. Whitney (1947),
doi:10.1214/aoms/1177730491; S. Holm, "A simple sequentially rejective multiple test procedure",
Scandinavian Journal of Statistics 6(2), 65-70 (1979).

Limits: the images are scikit-image's: the thesis' own nine are not freely packaged. A run that
misses the optimum counts as one that needs more evaluations than any other.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.stats import mannwhitneyu

from isc_core.thresholding import OtsuObjective, exact, particle_swarm
from isc_core.thresholding.clonal_selection import ClonalOptions

from ...separation.thresholding import COUNTS, IMAGES, OPTIMISERS, levels, to_optimum
from .context import Context, JsonRow

SEARCHES = {
    "PSO": "particle_swarm",
    "ClonalG": "clonal_selection",
    "CS": "chaotic_clonal",
    "CS, one orbit": "chaotic, one orbit",
}
COMPARED = ("PSO", "ClonalG", "CS")
_RUNS, _QUICK_RUNS, _TIMED_RUNS = 50, 3, 10
EVALUATIONS = 20_000
_QUICK_IMAGES = 3
_SURE = 1.959964  # standard deviations, of 95 %


@dataclass(frozen=True, eq=False)
class ThresholdRuns:
    """The n runs of one optimiser on one image.

    Attributes
    ----------
    values : (n,) ndarray
        Objective reached.
    needed : (n,) ndarray
        Evaluations until the optimum; infinite if missed.
    thresholds : (n, K) ndarray
        Thresholds.
    """

    values: np.ndarray
    needed: np.ndarray
    thresholds: np.ndarray

    @property
    def hits(self) -> int:
        """Number of runs that reach the optimum."""
        return int(np.isfinite(self.needed).sum())


def image_names(context: Context) -> tuple[str, ...]:
    """Return the names of the images; three in a quick run.

    Parameters
    ----------
    context : Context
        The run.

    Returns
    -------
    tuple of str
    """
    return IMAGES[:_QUICK_IMAGES] if context.quick else IMAGES


@cache
def image_objective(image: str) -> OtsuObjective:
    """Return Otsu's objective of an image.

    Parameters
    ----------
    image : str
        Name of the image.

    Returns
    -------
    OtsuObjective
    """
    return OtsuObjective.of(levels(image))


def threshold_runs(context: Context, search: str, image: str, count: int) -> ThresholdRuns:
    """Run a search repeatedly on one image, or load the kept runs.

    Parameters
    ----------
    context : Context
        The run.
    search : str
        One of `SEARCHES`.
    image : str
        Name of the image.
    count : int
        Number of thresholds.

    Returns
    -------
    ThresholdRuns
        All runs.

    Raises
    ------
    Cancelled
        If the user cancels.
    """
    rows = context.rows(
        f"thresholds {search} {image} {count}", lambda: _searched(context, search, image, count)
    )
    thresholds = [[int(level) for level in str(row["thresholds"]).split()] for row in rows]
    needed = np.array([np.inf if row["needed"] is None else row["needed"] for row in rows], float)
    return ThresholdRuns(
        np.array([row["value"] for row in rows], float), needed, np.array(thresholds)
    )


def search_times(context: Context, search: str, image: str, count: int) -> np.ndarray:
    """Time repeated runs of a search by the processor clock, which other load does not affect.

    Parameters
    ----------
    context : Context
        The run.
    search : str
        One of `SEARCHES`.
    image : str
        Name of the image.
    count : int
        Number of thresholds.

    Returns
    -------
    (n,) ndarray
        Milliseconds per run.

    Raises
    ------
    Cancelled
        If the user cancels.
    """

    def timed() -> list[JsonRow]:
        rows: list[JsonRow] = []
        for run in range(_QUICK_RUNS if context.quick else _TIMED_RUNS):
            begin = time.process_time()
            OPTIMISERS[SEARCHES[search]](
                image_objective(image), count, EVALUATIONS, context.seed + run
            )
            rows.append({"milliseconds": 1e3 * (time.process_time() - begin)})
        return rows

    return np.array(
        [
            row["milliseconds"]
            for row in context.rows(f"thresholds time {search} {image} {count}", timed)
        ],
        float,
    )


def run_searches(
    context: Context, searches: Sequence[str]
) -> dict[tuple[str, str, int], ThresholdRuns]:
    """Run several searches on all images.

    Parameters
    ----------
    context : Context
        The run.
    searches : sequence of str
        Of `SEARCHES`.

    Returns
    -------
    dict of (str, str, int) to ThresholdRuns
        Runs by search, image and number of thresholds.

    Raises
    ------
    Cancelled
        If the user cancels.
    """
    cases = [
        (search, image, count)
        for search in searches
        for image in image_names(context)
        for count in COUNTS
    ]
    found = {}
    for number, case in enumerate(cases):
        context.monitor.report(f"{case[0]} on {case[1]}, {case[2]} thresholds", number / len(cases))
        found[case] = threshold_runs(context, *case)
    return found


def count_iterations(search: str, evaluations: np.ndarray) -> np.ndarray:
    """Convert evaluations to generations of a search, or steps of the swarm.

    Parameters
    ----------
    search : str
        One of `SEARCHES`.
    evaluations : (n,) ndarray
        Numbers of evaluations.

    Returns
    -------
    (n,) ndarray
        Numbers of iterations.
    """
    if search == "PSO":
        first = each = particle_swarm.SwarmOptions().particles
    else:
        options = ClonalOptions()
        first = options.population
        each = first * max(1, round(options.clone_share * first)) + round(
            options.replaced_share * first
        )
    return np.ceil(np.maximum(evaluations - first, 0) / each)


def wilson_interval(hits: int, total: int) -> tuple[float, float]:
    """Compute the 95 % interval of a share, by Wilson.

    Parameters
    ----------
    hits, total : int
        Successes and trials.

    Returns
    -------
    low, high : float
        The interval, within [0, 1].
    """
    share, square = hits / total, _SURE**2
    middle = (share + square / (2 * total)) / (1 + square / total)
    half = (
        _SURE
        * np.sqrt(share * (1 - share) / total + square / (4 * total**2))
        / (1 + square / total)
    )
    return max(0.0, middle - half), min(1.0, middle + half)


def rank_sum_test(first: np.ndarray, second: np.ndarray) -> tuple[float, float]:
    """Compare two samples by the rank-sum test.

    Parameters
    ----------
    first, second : (n,), (m,) ndarray
        The samples; infinite values count as larger than any other.

    Returns
    -------
    share : float
        Share of pairs in which the first is larger, ties counting half.
    p : float
        Two-sided p value.
    """
    top = 2 * max(
        1.0, *(float(values[np.isfinite(values)].max(initial=0.0)) for values in (first, second))
    )
    pair = [np.where(np.isfinite(values), values, top) for values in (first, second)]
    if np.ptp(np.concatenate(pair)) == 0:
        return 0.5, 1.0
    test = mannwhitneyu(*pair)
    return float(test.statistic) / (len(first) * len(second)), float(test.pvalue)


def holm_correction(p_values: Sequence[float]) -> np.ndarray:
    """Correct p values for their number, by Holm.

    Parameters
    ----------
    p_values : sequence of float
        p values.

    Returns
    -------
    (n,) ndarray
        Corrected p values.
    """
    order = np.argsort(p_values)
    scaled = np.asarray(p_values, float)[order] * np.arange(len(order), 0, -1)
    corrected = np.empty(len(order))
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1)
    return corrected


def _searched(context: Context, search: str, image: str, count: int) -> list[JsonRow]:
    """Run a search repeatedly; one row per run."""
    best = exact(image_objective(image), count).value
    rows: list[JsonRow] = []
    for run in range(_QUICK_RUNS if context.quick else _RUNS):
        found = OPTIMISERS[SEARCHES[search]](
            image_objective(image), count, EVALUATIONS, context.seed + run
        )
        needed = to_optimum(found, best)
        rows.append(
            {
                "run": run,
                "thresholds": " ".join(map(str, found.thresholds)),
                "value": found.value,
                "needed": needed if np.isfinite(needed) else None,
            }
        )
    return rows
