"""Confidence interval of a mean over scenes by the percentile bootstrap.

Scenes are resampled with replacement and the mean is computed again each time; the central 95 % of
these means are the interval. Errors that span orders of magnitude are averaged as logarithms, so
that no single scene dominates.

Citation: B. Efron (1979), "Bootstrap methods: another look at the jackknife",
doi:10.1214/aos/1176344552.

Limits: with fewer than about ten scenes the interval is too narrow; scenes that share an object or
a light are not independent.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RESAMPLES = 2000
LEVEL = 0.95
_SMALLEST = 1e-30  # value of an error of 0 where logarithms are taken


@dataclass(frozen=True)
class Interval:
    """A value over scenes with its confidence interval.

    Attributes
    ----------
    value : float
        The value.
    low, high : float or None
        Ends of the interval, None for a single scene.
    scenes : int
        Number of scenes.
    """

    value: float
    low: float | None
    high: float | None
    scenes: int


def resampled_means(values: np.ndarray, seed: int, resamples: int = RESAMPLES) -> np.ndarray:
    """Compute means over scenes drawn with replacement.

    Parameters
    ----------
    values : (N, M) ndarray
        One row per scene; all columns use the same draws.
    seed : int
        Seed of the draws.
    resamples : int, optional
        Number of draws.

    Returns
    -------
    (resamples, M) ndarray
        The means.
    """
    scenes = len(values)
    counts = np.random.default_rng(seed).multinomial(
        scenes, np.full(scenes, 1 / scenes), size=resamples
    )
    return counts @ values / scenes


def percentile_interval(value: float, resampled: np.ndarray, scenes: int) -> Interval:
    """Return a value with the central 95 % of its resampled values.

    Parameters
    ----------
    value : float
        The value.
    resampled : (R,) ndarray
        The same statistic of resampled scenes.
    scenes : int
        Number of scenes; below 2 there is no interval.

    Returns
    -------
    Interval
        The interval.
    """
    if scenes < 2:
        return Interval(value, None, None, scenes)
    low, high = np.quantile(resampled, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(value, float(low), float(high), scenes)


def mean_interval(
    values: Sequence[float], *, geometric: bool, seed: int, resamples: int = RESAMPLES
) -> Interval:
    """Compute a mean over scenes with its interval.

    Parameters
    ----------
    values : sequence of float
        One finite value per scene.
    geometric : bool
        Use the geometric mean; values must be >= 0.
    seed : int
        Seed of the bootstrap.
    resamples : int, optional
        Number of draws.

    Returns
    -------
    Interval
        The mean.

    Raises
    ------
    ValueError
        Without values, or if one is not finite.
    """
    numbers = np.asarray(values, float)
    if not numbers.size or not np.isfinite(numbers).all():
        raise ValueError("a mean over scenes needs at least one, and only finite values")
    back = exponentials if geometric else np.asarray
    column = (logarithms(numbers) if geometric else numbers)[:, None]
    means = resampled_means(column, seed, resamples)[:, 0]
    return percentile_interval(float(back(column.mean())), back(means), len(numbers))


def logarithms(errors: np.ndarray) -> np.ndarray:
    """Return natural logarithms of errors; an error of 0 counts as 1e-30.

    Parameters
    ----------
    errors : ndarray
        Errors >= 0.

    Returns
    -------
    ndarray
        Of the same shape.
    """
    return np.log(np.maximum(errors, _SMALLEST))


def exponentials(logs: np.ndarray | float) -> np.ndarray:
    """Invert `logarithms`; the floor becomes 0 again.

    Parameters
    ----------
    logs : ndarray or float
        Natural logarithms.

    Returns
    -------
    ndarray
        Errors >= 0, of the same shape.
    """
    return np.where(logs <= np.log(_SMALLEST) + 1e-9, 0.0, np.exp(logs))
