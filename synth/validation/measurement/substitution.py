"""The error budget: how much of the chain's final error each stage causes, measured by substituting
its ground truth.

Problem: the chain is photo -> separation -> shape and light -> shading and reflectance. Three
ground truths can be substituted: the diffuse image, the shape, the light; all eight combinations
are run.

Equation: with E(S) the error (geometric mean over scenes) under the ground truths S, a stage's
share is the reduction of the error by its truth, averaged over the orders in which truths can be
added, divided by E(nothing). The shares and the error that remains with all truths sum to 1. A
negative share means that the chain does better with the error than without it: stages compensate
each other.

Citation: L. S. Shapley (1953), "A value for n-person games", doi:10.1515/9781400881970-018 (the
average over orders).

No stage can reduce the error that remains with all truths: rendered shading is not exp(SH(normal))
(cast shadows, hard lights), and normals are finite differences of heights on the pixel grid. The
second part vanishes with exact normals, which is measured, too. Errors that a truth defines (height
and normal by the shape, light by the light) are shared among the other truths only.

Limits: shares are of errors of typical scenes (geometric mean); truths are substituted at the
resolution of the picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np

from isc_core.evaluation.metrics import Scores, geometric_mean
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation

from ...capture.truth import GroundTruth
from ..stages.sirfs import SIRFS, run_sirfs, score_sirfs, with_normals
from ..stages.types import Metric, StageOptions, Truth, stage_inputs
from .bootstrap import (
    RESAMPLES,
    Interval,
    exponentials,
    logarithms,
    percentile_interval,
    resampled_means,
)

TRUTHS: tuple[Truth, ...] = ("diffuse", "shape", "light")
COMBINATIONS: tuple[tuple[Truth, ...], ...] = tuple(
    found for size in range(4) for found in combinations(TRUTHS, size)
)
METRICS = (Metric("images", "shading and reflectance"), *SIRFS.metrics)


@dataclass(frozen=True)
class ChainScores:
    """The chain's errors on one scene.

    Attributes
    ----------
    swapped : tuple of Scores
        One per entry of `COMBINATIONS`.
    untouched : Scores
        With the photo as diffuse image, without separation.
    exact_normals : Scores
        With all ground truths and the exact normals.
    light_fit_residual : float
        Of the scene's light, see `capture.truth`.
    """

    swapped: tuple[Scores, ...]
    untouched: Scores
    exact_normals: Scores
    light_fit_residual: float

    def under(self, truths: tuple[Truth, ...]) -> Scores:
        """Return the errors under ground truths.

        Parameters
        ----------
        truths : tuple of str
            The substituted ground truths, in the order of `TRUTHS`.

        Returns
        -------
        Scores
            The chain's errors.
        """
        return self.swapped[COMBINATIONS.index(truths)]


@dataclass(frozen=True)
class Share:
    """The contribution of one ground truth.

    Attributes
    ----------
    truth : str
        The ground truth.
    share : Interval
        Reduction of the final error, averaged over orders, as a share of it.
    alone : Interval
        Error under this ground truth alone, divided by that of the chain.
    """

    truth: Truth
    share: Interval
    alone: Interval


@dataclass(frozen=True)
class Budget:
    """One metric's error budget over scenes.

    Attributes
    ----------
    metric : Metric
        The metric.
    error : Interval
        The chain's error.
    shares : tuple of Share
        The ground truths' shares.
    rest : Interval
        Share that remains with all ground truths.
    exact : Interval
        Share that remains with exact normals too.
    """

    metric: Metric
    error: Interval
    shares: tuple[Share, ...]
    rest: Interval
    exact: Interval


def run_chain(
    truth: GroundTruth, split: Separation, alone: Scores, options: StageOptions, monitor: Monitor
) -> ChainScores:
    """Run the chain under every combination of ground truths.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    split : Separation
        Result of the stage "separation".
    alone : Scores
        Errors of SIRFS on the true diffuse image, which is one of the combinations.
    options : StageOptions
        Options of the stages.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    ChainScores
        The errors.

    Raises
    ------
    InputError
        If a stage cannot process the scene.
    Cancelled
        If the user cancels.
    """

    def scored(truths: tuple[Truth, ...], diffuse: np.ndarray) -> Scores:
        return score_sirfs(truth, run_sirfs(stage_inputs(truth, truths, diffuse), options, monitor))

    swapped = tuple(
        alone if truths == ("diffuse",) else scored(truths, split.diffuse)
        for truths in COMBINATIONS
    )
    exact = with_normals(
        stage_inputs(truth, TRUTHS),
        truth.height.astype(float),
        truth.normal.astype(float),
        truth.illumination,
    )
    return ChainScores(
        swapped, scored((), truth.image), score_sirfs(truth, exact), truth.light_fit_residual
    )


def chain_value(scores: Scores, metric: str) -> float:
    """Return one error of the chain.

    Parameters
    ----------
    scores : Scores
        All errors.
    metric : str
        A name in `METRICS`; "images" is the geometric mean of the errors of shading, reflectance
        and both locally.

    Returns
    -------
    float
        The error.
    """
    if metric == "images":
        return geometric_mean((scores.shading, scores.reflectance, scores.rs_mse))
    return float(getattr(scores, metric))


def budget(
    metric: Metric, scenes: Sequence[ChainScores], seed: int, resamples: int = RESAMPLES
) -> Budget:
    """Compute the error budget of one metric, with bootstrap intervals over scenes.

    Parameters
    ----------
    metric : Metric
        One of `METRICS`.
    scenes : sequence of ChainScores
        At least one.
    seed : int
        Seed of the bootstrap.
    resamples : int, optional
        Number of draws.

    Returns
    -------
    Budget
        The budget.

    Raises
    ------
    ValueError
        Without scenes.
    """
    if not scenes:
        raise ValueError("an error budget needs at least one scene")
    players = tuple(truth for truth in TRUTHS if truth not in metric.given_by)
    coalitions = [truths for truths in COMBINATIONS if set(truths) <= set(players)]
    rows = [
        [chain_value(s.under(truths), metric.name) for truths in coalitions]
        + [_exact(s, metric, players)]
        for s in scenes
    ]
    logs = logarithms(np.array(rows))
    errors = exponentials(
        np.concatenate([logs.mean(axis=0)[None], resampled_means(logs, seed, resamples)])
    )  # the value, then its resamples
    final = np.maximum(errors[:, 0], 1e-30)
    place = {frozenset(truths): k for k, truths in enumerate(coalitions)}

    def interval(values: np.ndarray) -> Interval:
        return percentile_interval(float(values[0]), values[1:], len(scenes))

    shares = tuple(
        Share(
            player,
            interval(_shapley(errors, place, player, players) / final),
            interval(errors[:, place[frozenset({player})]] / final),
        )
        for player in players
    )
    rest = errors[:, place[frozenset(players)]] / final
    return Budget(
        metric, interval(errors[:, 0]), shares, interval(rest), interval(errors[:, -1] / final)
    )


def _exact(scores: ChainScores, metric: Metric, players: tuple[Truth, ...]) -> float:
    """The error with exact normals if all ground truths count, otherwise that with all of
    `players`.
    """
    return chain_value(
        scores.exact_normals if players == TRUTHS else scores.under(players), metric.name
    )


def _shapley(
    errors: np.ndarray,
    place: dict[frozenset[Truth], int],
    player: Truth,
    players: tuple[Truth, ...],
) -> np.ndarray:
    """Reduction (R,) of errors (R, coalitions) by `player`, averaged over the orders of the
    players.
    """
    saved = np.zeros(len(errors))
    count = len(players)
    for before in place:
        if player not in before:
            weight = factorial(len(before)) * factorial(count - len(before) - 1) / factorial(count)
            saved += weight * (errors[:, place[before]] - errors[:, place[before | {player}]])
    return saved
