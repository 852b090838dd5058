"""Gain of a model as a share of the gain of the true diffuse layer.

Equation: with r the geometric mean over scenes of an error relative to plain SIRFS, the gain is
1 - r, and the share of a model m is

    (1 - r_m) / (1 - r_true diffuse),   if the gain of the true diffuse layer is at least `LEAST`

Its interval is bootstrapped over scenes (`bootstrap`), with the same draws for numerator and
denominator.

Limits: the interval of a ratio is undefined where the denominator may be zero; it is omitted unless
the gain of the true diffuse layer is significant.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..stages.models import ERRORS, NAME, PLAIN, TRUE_DIFFUSE, metric_name
from .bootstrap import Interval, logarithms, percentile_interval, resampled_means
from .figures import scene_value
from .measure import SceneResult
from .slices import Slice, all_slices

LEAST = 0.05


@dataclass(frozen=True)
class Gain:
    """Share of the true diffuse layer's gain that a model reaches.

    Attributes
    ----------
    model, error : str
        The model, and the name of one of `ERRORS`.
    group : Slice
        The scenes.
    share : Interval
        The share.
    """

    model: str
    error: str
    group: Slice
    share: Interval


def all_gains(scenes: Sequence[SceneResult], seed: int) -> tuple[Gain, ...]:
    """Compute the shares of every model, error and slice where the true diffuse layer gains.

    Parameters
    ----------
    scenes : sequence of SceneResult
        The scenes that could be run.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    tuple of Gain
        Empty if the stage "models" was not run.
    """
    scores = scenes[0].scores(NAME) if scenes else None
    if scores is None:
        return ()
    models = [name for name, _ in scores.items() if name not in (PLAIN, TRUE_DIFFUSE)]
    groups = all_slices([scene.facts for scene in scenes])
    return tuple(
        gain
        for group in groups
        for gain in _gains([scenes[k] for k in group.members], models, group, seed)
    )


def _gains(
    scenes: Sequence[SceneResult], models: Sequence[str], group: Slice, seed: int
) -> Iterator[Gain]:
    for error in ERRORS:
        names = [metric_name(variant, error.name) for variant in (TRUE_DIFFUSE, *models)]
        logs = logarithms(
            np.array(
                [[scene_value(scene, NAME, name) for name in names] for scene in scenes], float
            )
        )
        gains = 1 - np.exp(
            np.concatenate([logs.mean(axis=0)[None], resampled_means(logs, seed)])
        )  # the value, then its resamples
        ceiling = percentile_interval(float(gains[0, 0]), gains[1:, 0], len(scenes))
        if ceiling.value >= LEAST:
            yield from (
                Gain(model, error.name, group, _share(gains[:, k], gains[:, 0], ceiling))
                for k, model in enumerate(models, 1)
            )


def _share(gain: np.ndarray, most: np.ndarray, ceiling: Interval) -> Interval:
    """The share, with an interval if the gain of the true diffuse layer (`most`) is significant.

    The first of the values is the measured one, the others are resampled.
    """
    value = float(gain[0] / most[0])
    if ceiling.low is None or ceiling.low <= 0:
        return Interval(value, None, None, ceiling.scenes)
    return percentile_interval(value, gain[1:] / np.maximum(most[1:], 1e-9), ceiling.scenes)
