"""The error budget: how much of the chain's final error each stage causes, found by swapping in the
truth for its answer.

The chain is photo -> separation -> shape and light -> shading and reflectance. Three truths can be
handed over: the diffuse image, the shape, the light; all eight combinations are run. With E(S) the
error (geometric mean over scenes) when the truths S are given, a stage's share is what its truth
saves, averaged over the orders in which truths may be handed over, over E(nothing): the shares and
what is left with all truths add up to 1. A share below 0 says that the chain does better with the
error than without it: stages make up for each other.

Citation: L. S. Shapley (1953), "A value for n-person games", doi:10.1515/9781400881970-018 (the
average over orders).

What is left with all truths no stage can remove: rendered shading is not exp(SH(normal)) (cast
shadows, sharp lights), and normals come from differences of heights on the pixel grid; the second
goes away with exact normals, which is measured too.

Errors that a truth hands over (height and normal by the shape, light by the light) are shared out
among the other truths alone.

Limits: shares are of errors of typical scenes (geometric mean); truths are swapped in at the
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

    `swapped`: one for each of `COMBINATIONS`. `untouched`: with the photo taken as diffuse, nothing
    separated. `exact_normals`: with all truths and the exact normals besides. `light_fit_residual`:
    of the scene's light, see `truth`.
    """

    swapped: tuple[Scores, ...]
    untouched: Scores
    exact_normals: Scores
    light_fit_residual: float

    def under(self, truths: tuple[Truth, ...]) -> Scores:
        """The errors when `truths`, in the order of `TRUTHS`, are handed over."""
        return self.swapped[COMBINATIONS.index(truths)]


@dataclass(frozen=True)
class Share:
    """What one truth saves: `share` of the final error, averaged over the orders; `alone`: error
    when it alone is handed over, over that of the chain.
    """

    truth: Truth
    share: Interval
    alone: Interval


@dataclass(frozen=True)
class Budget:
    """One metric's error budget over scenes: the chain's `error`, the shares of the stages, and
    `rest`, the share that stays with all truths; `exact`: that share with exact normals besides.
    """

    metric: Metric
    error: Interval
    shares: tuple[Share, ...]
    rest: Interval
    exact: Interval


def run_chain(
    truth: GroundTruth, split: Separation, alone: Scores, options: StageOptions, monitor: Monitor
) -> ChainScores:
    """Runs the chain under every combination of truths.

    `split`: what the separation found; `alone`: SIRFS' errors on the true diffuse image, which are
    one of the combinations. Raises `InputError`, `Cancelled`.
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
    """One error by the name that `METRICS` gives it; "images" is the geometric mean of shading,
    reflectance and their local error.
    """
    if metric == "images":
        return geometric_mean((scores.shading, scores.reflectance, scores.rs_mse))
    return float(getattr(scores, metric))


def budget(
    metric: Metric, scenes: Sequence[ChainScores], seed: int, resamples: int = RESAMPLES
) -> Budget:
    """The error budget of one metric, with intervals by resampling scenes.

    Raises `ValueError` without scenes.
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
    """The error with all truths and exact normals, where all truths are handed over; else that with
    all of `players`.
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
    """What `player` saves (R,), of errors (R, coalitions), averaged over the orders of the players."""
    saved = np.zeros(len(errors))
    count = len(players)
    for before in place:
        if player not in before:
            weight = factorial(len(before)) * factorial(count - len(before) - 1) / factorial(count)
            saved += weight * (errors[:, place[before]] - errors[:, place[before | {player}]])
    return saved
