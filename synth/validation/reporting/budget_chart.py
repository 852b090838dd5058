"""Geometry of the error budget's bar chart, which the page draws as SVG."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..measurement.bootstrap import Interval
from ..measurement.substitution import Budget
from .formatting import percent
from .tables import REMAINING, TRUTH_TITLES

_COLORS = {"diffuse": "#e08a3c", "shape": "#5b9bd5", "light": "#e3c94b"}
_COLOR_OF_REST = "#8d8f94"
_WIDTH, _LABELS, _VALUES = 1000.0, 290.0, 190.0  # of the chart, its names and its figures, pixels
_BAR, _GAP = 15, 16
_RANGE = (-1.5, 2.5)  # shares beyond it are cut off


@dataclass(frozen=True)
class ChartBar:
    """One bar.

    Attributes
    ----------
    name, value : str
        Texts at its left and right.
    color : str
        CSS colour.
    left, top, width : float
        Pixels.
    whiskers : (float, float) or None
        x of the interval's ends.
    """

    name: str
    value: str
    color: str
    left: float
    top: float
    width: float
    whiskers: tuple[float, float] | None


@dataclass(frozen=True)
class ChartGroup:
    """The bars of one error.

    Attributes
    ----------
    title : str
        The error.
    top : float
        y of the group in pixels.
    bars : tuple of ChartBar
        From top to bottom.
    """

    title: str
    top: float
    bars: tuple[ChartBar, ...]


@dataclass(frozen=True)
class BudgetChart:
    """Bars of shares, one group per error.

    Attributes
    ----------
    width, height, bar_height : float
        Pixels.
    zero, labels, values : float
        x of the zero line, of the right end of the names, and of the left end of the figures.
    groups : tuple of ChartGroup
        From top to bottom.
    """

    width: float
    height: float
    bar_height: float
    zero: float
    labels: float
    values: float
    groups: tuple[ChartGroup, ...]


@dataclass(frozen=True)
class _Share:
    name: str
    color: str
    interval: Interval


def budget_chart(budgets: Sequence[Budget]) -> BudgetChart:
    """Lay out the shares of error budgets with their intervals.

    Parameters
    ----------
    budgets : sequence of Budget
        At least one.

    Returns
    -------
    BudgetChart
        The geometry.
    """
    rows = [(found.metric.title, _shares(found)) for found in budgets]
    ends = [
        end
        for _, shares in rows
        for share in shares
        for end in (share.interval.value, share.interval.low, share.interval.high)
        if end is not None
    ]
    low, high = max(min(0.0, *ends), _RANGE[0]), min(max(1.0, *ends), _RANGE[1])
    left, span = _LABELS + 10, _WIDTH - _LABELS - 10 - _VALUES

    def x(value: float) -> float:
        return left + (min(max(value, low), high) - low) / (high - low) * span

    groups, top = [], 10.0
    for title, shares in rows:
        bars = []
        for share in shares:
            interval = share.interval
            start, stop = sorted((x(0.0), x(interval.value)))
            whiskers = None
            if interval.low is not None and interval.high is not None:
                whiskers = (x(interval.low), x(interval.high))
            width = max(stop - start, 1)
            text = percent(interval)
            bars.append(ChartBar(share.name, text, share.color, start, top, width, whiskers))
            top += _BAR
        groups.append(ChartGroup(title, bars[0].top, tuple(bars)))
        top += _GAP
    end = _WIDTH - _VALUES + 14
    return BudgetChart(_WIDTH, top, _BAR - 3, x(0.0), _LABELS, end, tuple(groups))


def _shares(found: Budget) -> list[_Share]:
    shares = [_Share(TRUTH_TITLES[s.truth], _COLORS[s.truth], s.share) for s in found.shares]
    return [*shares, _Share(REMAINING, _COLOR_OF_REST, found.rest)]
