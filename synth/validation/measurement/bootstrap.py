"""How sure a mean over scenes is: the percentile bootstrap.

Scenes are drawn with replacement, as many as there are, the mean is taken again each time, and the
middle 95 % of these means are the interval. Errors that span powers of ten are averaged as
logarithms, so that no single scene decides.

Citation: B. Efron (1979), "Bootstrap methods: another look at the jackknife",
doi:10.1214/aos/1176344552.

Limits: with fewer than about ten scenes the interval is somewhat too narrow; scenes that share an
object or a light are not independent.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RESAMPLES = 2000
LEVEL = 0.95
_SMALLEST = 1e-30  # what an error of 0 counts as where logarithms are taken


@dataclass(frozen=True)
class Interval:
    """A value over `scenes` scenes and its interval;

    `low` and `high` are None where one scene is all there is.
    """

    value: float
    low: float | None
    high: float | None
    scenes: int


def resampled_means(values: np.ndarray, seed: int, resamples: int = RESAMPLES) -> np.ndarray:
    """Means (resamples, M) over scenes drawn with replacement, of `values` (N, M): every column is
    drawn with the same scenes.
    """
    scenes = len(values)
    counts = np.random.default_rng(seed).multinomial(
        scenes, np.full(scenes, 1 / scenes), size=resamples
    )
    return counts @ values / scenes


def percentile_interval(value: float, resampled: np.ndarray, scenes: int) -> Interval:
    """`value` with the middle 95 % of its resampled values (R,)."""
    if scenes < 2:
        return Interval(value, None, None, scenes)
    low, high = np.quantile(resampled, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(value, float(low), float(high), scenes)


def mean_interval(
    values: Sequence[float], *, geometric: bool, seed: int, resamples: int = RESAMPLES
) -> Interval:
    """The mean of finite numbers, one a scene, and its interval;

    `geometric`: of numbers >= 0. Raises `ValueError` without any.
    """
    numbers = np.asarray(values, float)
    if not numbers.size or not np.isfinite(numbers).all():
        raise ValueError("a mean over scenes needs at least one, and only finite values")
    back = exponentials if geometric else np.asarray
    column = (logarithms(numbers) if geometric else numbers)[:, None]
    means = resampled_means(column, seed, resamples)[:, 0]
    return percentile_interval(float(back(column.mean())), back(means), len(numbers))


def logarithms(errors: np.ndarray) -> np.ndarray:
    """Natural logarithms of errors >= 0; an error of 0 counts as 1e-30."""
    return np.log(np.maximum(errors, _SMALLEST))


def exponentials(logs: np.ndarray | float) -> np.ndarray:
    """The inverse of `logarithms`: the floor itself becomes 0 again."""
    return np.where(logs <= np.log(_SMALLEST) + 1e-9, 0.0, np.exp(logs))
