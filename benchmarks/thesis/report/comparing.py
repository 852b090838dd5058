"""Comparison of two methods over the same subjects, for table cells and verdicts.

Equation: the ratio of geometric means, exp(mean_k log a_k / b_k), with the percentile interval of
resampled objects, each with all of its subjects k, since subjects that show the same object are not
independent; for repeated runs on one subject, the two-sided rank-sum test.

Citation: B. Efron (1979), doi:10.1214/aos/1176344552; H. B. Mann, D. R. Whitney (1947),
doi:10.1214/aoms/1177730491.

Limits: fewer than two objects give no interval; few objects give one that is too narrow.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.stats import mannwhitneyu

from isc_core.evaluation.evaluate import Ratio

from ...bootstrap import bootstrap_samples, interval
from .item import ClaimVerdict, Holds

_RESAMPLES = 10_000


def paired_ratio(
    ours: Mapping[str, float],
    theirs: Mapping[str, float],
    seed: int,
    object_of: Callable[[str], str] = str,
) -> Ratio | None:
    """Compute the ratio of geometric means over common subjects.

    Parameters
    ----------
    ours, theirs : mapping of str to float
        Errors by subject; subjects with an error of 0 are skipped.
    seed : int
        Seed of the bootstrap.
    object_of : callable, optional
        Returns the object that a subject shows; by default, each shows another one.

    Returns
    -------
    Ratio or None
        Ratio with its 95 % interval; None for subjects of fewer than two objects.
    """
    logarithms: dict[str, list[float]] = {}
    for name, value in ours.items():
        if value > 0 and (other := theirs.get(name, 0)) > 0:
            logarithms.setdefault(object_of(name), []).append(math.log(value) - math.log(other))
    if len(logarithms) < 2:
        return None
    rows = np.array([(sum(each), len(each)) for each in logarithms.values()])
    drawn = bootstrap_samples(rows, np.random.default_rng(seed), _RESAMPLES).sum(axis=1)
    low, high = interval(drawn[:, 0] / drawn[:, 1])
    sums, counts = rows.T
    return Ratio(*map(math.exp, (sums.sum() / counts.sum(), float(low), float(high))))


def object_of_kind(subject: str) -> str:
    """Return the object of a subject that is named by its kind and name.

    Parameters
    ----------
    subject : str
        As in "specular apple".

    Returns
    -------
    str
        As in "apple", which other kinds may show as well.
    """
    return subject.partition(" ")[2]


def label_with_refusals(label: str, refused: int, count: int) -> str:
    """Add to the label of a method the number of subjects that its means do not contain.

    Parameters
    ----------
    label : str
        Name of the method.
    refused : int
        Number of subjects that it refuses.
    count : int
        Number of all subjects.

    Returns
    -------
    str
    """
    return f"{label} (refuses {refused} of {count})" if refused else label


def format_ratio(ratio: Ratio | None) -> str:
    """Format a ratio and its interval for a table cell.

    Parameters
    ----------
    ratio : Ratio or None

    Returns
    -------
    str
        A dash for None.
    """
    if ratio is None:
        return "-"
    return f"{_brief(ratio.ratio)} ({_brief(ratio.low)} to {_brief(ratio.high)})"


def _brief(value: float) -> str:
    """Format with three decimals, from 100 on without any."""
    return f"{value:.3f}" if value < 100 else f"{value:,.0f}"


def rank_sum_p(ours: Sequence[float], theirs: Sequence[float]) -> float | None:
    """Compute the two-sided p value of the rank-sum test.

    Parameters
    ----------
    ours, theirs : sequence of float
        Results of repeated runs.

    Returns
    -------
    float or None
        p value; None for fewer than three runs.
    """
    if min(len(ours), len(theirs)) < 3:
        return None
    return 1.0 if len({*ours, *theirs}) == 1 else float(mannwhitneyu(ours, theirs).pvalue)


def judge_reduction(claim: str, claimed: float, ratio: Ratio | None, what: str) -> ClaimVerdict:
    """Judge whether an error is reduced as claimed.

    Parameters
    ----------
    claim : str
        The claim.
    claimed : float
        Claimed reduction, a share of 1.
    ratio : Ratio or None
        Measured ratio of the errors.
    what : str
        Name of the error in the verdict.

    Returns
    -------
    ClaimVerdict
        YES if the error is lower by the claimed share and the interval excludes 1; PARTLY if lower
        by less; NO if the interval includes 1 but not the claim; UNDETERMINED if it includes both.
    """
    if ratio is None:
        reason = "fewer than two objects with an error"
        return ClaimVerdict(claim, "-", Holds.UNDETERMINED, reason)
    change = f"{100 * abs(1 - ratio.ratio):.1f} % {'lower' if ratio.ratio <= 1 else 'higher'}"
    here = f"{what} {change}: ratio {format_ratio(ratio)}"
    if ratio.high >= 1 and ratio.low <= 1 - claimed:
        reason = "too few subjects: the interval includes both the claim and no change"
        return ClaimVerdict(claim, here, Holds.UNDETERMINED, reason)
    if ratio.high >= 1 > ratio.low:
        reason = "the interval includes no change and excludes the claim"
        return ClaimVerdict(claim, here, Holds.NO, reason)
    if ratio.high >= 1:
        return ClaimVerdict(claim, here, Holds.NO, "not lower at all")
    if 1 - ratio.ratio >= claimed:
        return ClaimVerdict(claim, here, Holds.YES)
    within = "; the interval includes the claim" if ratio.low <= 1 - claimed else ""
    reason = f"lower, but by less than claimed{within}"
    return ClaimVerdict(claim, here, Holds.PARTLY, reason)
