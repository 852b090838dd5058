"""All results of a validation as a flat list: one metric of a stage over one slice of the scenes,
with its interval.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..stages.types import AnyStage, Metric
from .bootstrap import Interval, mean_interval
from .measure import SceneResult
from .slices import Slice, all_slices
from .substitution import METRICS, chain_value

CHAIN = "chain"  # the whole chain from the photo, named like a stage


@dataclass(frozen=True)
class Figure:
    """The mean of a metric over a slice.

    Attributes
    ----------
    stage : str
        Name of the stage, or "chain".
    metric : Metric
        The metric.
    group : Slice
        The scenes.
    interval : Interval
        Mean over the scenes of `group` where the metric is defined.
    """

    stage: str
    metric: Metric
    group: Slice
    interval: Interval


def metrics_of(
    stages: Sequence[AnyStage], scenes: Sequence[SceneResult]
) -> tuple[tuple[str, Metric], ...]:
    """Return stage and metric of all measurements, the chain last.

    Parameters
    ----------
    stages : sequence of Stage
        The stages that were run.
    scenes : sequence of SceneResult
        The scenes.

    Returns
    -------
    tuple of (str, Metric)
        Name of the stage (or "chain") and metric.
    """
    found = [(stage.name, metric) for stage in stages for metric in stage.metrics]
    if any(scene.chain is not None for scene in scenes):
        found += [(CHAIN, metric) for metric in METRICS]
    return tuple(found)


def scene_value(scene: SceneResult, stage: str, metric: str) -> float | None:
    """Return one scene's value of a metric.

    Parameters
    ----------
    scene : SceneResult
        The scene.
    stage : str
        Name of the stage, or "chain".
    metric : str
        Field of the scores; "joint.average" is a field of a field.

    Returns
    -------
    float or None
        None where the stage was not run or the metric is undefined.
    """
    if stage == CHAIN:
        return None if scene.chain is None else chain_value(scene.chain.under(()), metric)
    value = scene.scores(stage)
    for field in metric.split("."):
        value = None if value is None else getattr(value, field)
    return None if value is None else float(value)


def all_figures(
    stages: Sequence[AnyStage], scenes: Sequence[SceneResult], seed: int
) -> tuple[Figure, ...]:
    """Compute every metric over every slice.

    Parameters
    ----------
    stages : sequence of Stage
        The stages that were run.
    scenes : sequence of SceneResult
        The scenes that could be run.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    tuple of Figure
        Without metrics that are defined on no scene of a slice.
    """
    return tuple(_figures(stages, scenes, seed))


def _figures(
    stages: Sequence[AnyStage], scenes: Sequence[SceneResult], seed: int
) -> Iterator[Figure]:
    groups = all_slices([scene.facts for scene in scenes])
    for stage, metric in metrics_of(stages, scenes):
        values = [scene_value(scene, stage, metric.name) for scene in scenes]
        for group in groups:
            known = [value for k in group.members if (value := values[k]) is not None]
            if known:
                yield Figure(
                    stage,
                    metric,
                    group,
                    mean_interval(known, geometric=metric.geometric, seed=seed),
                )
