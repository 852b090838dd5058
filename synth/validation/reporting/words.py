"""Figures as people read them: three digits that matter, with their interval."""

from ..measurement.bootstrap import Interval


def number(value: float) -> str:
    """Three digits that matter."""
    return f"{value:.3g}"


def with_interval(interval: Interval) -> str:
    """A value and its interval: "0.031 [0.024, 0.040]"."""
    if interval.low is None or interval.high is None:
        return number(interval.value)
    return f"{number(interval.value)} [{number(interval.low)}, {number(interval.high)}]"


def percent(interval: Interval) -> str:
    """A share and its interval in per cent: "42 % [30, 55]"."""
    if interval.low is None or interval.high is None:
        return f"{round(100 * interval.value)} %"
    return f"{round(100 * interval.value)} % [{round(100 * interval.low)}, {round(100 * interval.high)}]"
