"""How two methods compare over the same subjects, in a table's cell and in a verdict.

Equation: the ratio of geometric means, exp(mean_k log a_k / b_k), with the percentile interval of
resampled subjects k; for runs that are repeated on one subject, the two-sided rank-sum test.

Citation: B. Efron (1979), doi:10.1214/aos/1176344552; H. B. Mann, D. R. Whitney (1947),
doi:10.1214/aoms/1177730491.

Limits: below two subjects there is no interval; with few, it is too narrow.
"""

import math
from collections.abc import Mapping, Sequence

from scipy.stats import mannwhitneyu

from isc_core.evaluation.evaluate import Ratio, paired_bootstrap

from .item import ClaimVerdict


def paired_ratio(ours: Mapping[str, float], theirs: Mapping[str, float], seed: int) -> Ratio | None:
    """Ours over theirs, over the subjects that both have with errors above 0;

    None for fewer than two.
    """
    both = [name for name, value in ours.items() if value > 0 and theirs.get(name, 0) > 0]
    if len(both) < 2:
        return None
    return paired_bootstrap(
        [math.log(ours[name]) for name in both], [math.log(theirs[name]) for name in both], seed
    )


def format_ratio(found: Ratio | None) -> str:
    """A cell: the ratio and its interval."""
    return (
        "-"
        if found is None
        else f"{_brief(found.ratio)} ({_brief(found.low)} to {_brief(found.high)})"
    )


def _brief(value: float) -> str:
    """With three decimals, from a hundred on without any."""
    return f"{value:.3f}" if value < 100 else f"{value:,.0f}"


def rank_sum_p(ours: Sequence[float], theirs: Sequence[float]) -> float | None:
    """The probability of a difference like this between repeated runs by chance;

    None for fewer than three runs.
    """
    if min(len(ours), len(theirs)) < 3:
        return None
    return 1.0 if len({*ours, *theirs}) == 1 else float(mannwhitneyu(ours, theirs).pvalue)


def judge_reduction(claim: str, claimed: float, found: Ratio | None, what: str) -> ClaimVerdict:
    """Whether an error is lower by `claimed`, a share of 1: yes, if by that much or more and
    surely; partly, if lower and surely; no, if the interval holds no difference but not the claim.
    Where it holds both, nobody can tell.
    """
    if found is None:
        return ClaimVerdict(claim, "-", "cannot be told", "fewer than two subjects with an error")
    change = f"{100 * abs(1 - found.ratio):.1f} % {'lower' if found.ratio <= 1 else 'higher'}"
    here = f"{what} {change}: ratio {in_words(found)}"
    if found.high >= 1 and found.low <= 1 - claimed:
        return ClaimVerdict(
            claim,
            here,
            "cannot be told",
            "too few subjects: the interval holds the claim, and no difference as well",
        )
    if found.high >= 1:
        return ClaimVerdict(
            claim,
            here,
            "no",
            "the interval holds no difference, and not the claim"
            if found.low < 1
            else "not lower at all",
        )
    if 1 - found.ratio >= claimed:
        return ClaimVerdict(claim, here, "yes")
    return ClaimVerdict(claim, here, "partly", "lower, by less than is claimed")
