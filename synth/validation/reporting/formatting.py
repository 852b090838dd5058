"""Formatting of numbers in the report: three significant digits, with their interval."""

from ..measurement.bootstrap import Interval


def number(value: float) -> str:
    """Format a number with three significant digits.

    Parameters
    ----------
    value : float
        The number.

    Returns
    -------
    str
        For example "0.031".
    """
    return f"{value:.3g}"


def with_interval(interval: Interval) -> str:
    """Format a value and its interval.

    Parameters
    ----------
    interval : Interval
        The value with its interval.

    Returns
    -------
    str
        "0.031 [0.024, 0.040]"; only the value if there is no interval.
    """
    if interval.low is None or interval.high is None:
        return number(interval.value)
    return f"{number(interval.value)} [{number(interval.low)}, {number(interval.high)}]"


def percent(interval: Interval) -> str:
    """Format a share and its interval in per cent.

    Parameters
    ----------
    interval : Interval
        The share with its interval; 1 is all.

    Returns
    -------
    str
        "42 % [30, 55]"; only the share if there is no interval.
    """
    share = f"{round(100 * interval.value)} %"
    if interval.low is None or interval.high is None:
        return share
    return f"{share} [{round(100 * interval.low)}, {round(100 * interval.high)}]"
