"""Confidence intervals of figures over objects: the percentile bootstrap.

Problem: a benchmark measures a few dozen objects, and its figure depends on which ones they are.

Equation: draw N of the N objects with replacement, compute the figure of each drawn set, and take
the 2.5th and the 97.5th percentile.

Citation: B. Efron, "Bootstrap methods: another look at the jackknife", Annals of Statistics 7(1),
1979, doi:10.1214/aos/1176344552.

Limits: with few objects the interval is too narrow.
"""

from collections.abc import Hashable, Iterator, Sequence

import numpy as np


def bootstrap_samples(
    values: np.ndarray, rng: np.random.Generator | None = None, count: int = 2000
) -> np.ndarray:
    """Draw sets of objects with replacement.

    Parameters
    ----------
    values : (N, ...) ndarray
        One row per object.
    rng : Generator, optional
        By default one of seed 0.
    count : int, optional
        Number of sets.

    Returns
    -------
    (count, N, ...) ndarray
    """
    rng = rng or np.random.default_rng(0)
    return values[rng.integers(len(values), size=(count, len(values)))]


def cluster_samples(
    values: np.ndarray,
    clusters: Sequence[Hashable],
    rng: np.random.Generator | None = None,
    count: int = 2000,
) -> Iterator[np.ndarray]:
    """Draw sets of clusters with replacement: photos of one scene are not independent.

    Parameters
    ----------
    values : (N, ...) ndarray
        One row per photo.
    clusters : sequence of N hashable objects
        The scene of each photo.
    rng : Generator, optional
        By default one of seed 0.
    count : int, optional
        Number of sets.

    Yields
    ------
    (M, ...) ndarray
        The photos of the drawn clusters; M differs where clusters differ in size.
    """
    members = dict[Hashable, list[int]]()
    for row, cluster in enumerate(clusters):
        members.setdefault(cluster, []).append(row)
    rows = [np.array(one) for one in members.values()]
    rng = rng or np.random.default_rng(0)
    for drawn in rng.integers(len(rows), size=(count, len(rows))):
        yield values[np.concatenate([rows[k] for k in drawn])]


def interval(figures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the 95 % interval of a figure.

    Parameters
    ----------
    figures : (count, ...) ndarray
        Of each set of `bootstrap_samples`.

    Returns
    -------
    low, high : (...) ndarray
    """
    low, high = np.quantile(figures, (0.025, 0.975), axis=0)
    return low, high
