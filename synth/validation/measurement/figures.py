"""All figures of a validation as one flat list: a stage's metric over a slice of the scenes, with
its interval.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..stages.types import AnyStage, Metric
from .bootstrap import Interval, mean_interval
from .measure import SceneResult
from .slices import Slice, all_slices
from .substitution import METRICS, chain_value

CHAIN = "chain"  # the whole way from the photo, as if it were a stage


@dataclass(frozen=True)
class Figure:
    """`stage`: its name, or "chain".

    `interval`: of the metric's mean over the scenes of `group` where it is defined.
    """

    stage: str
    metric: Metric
    group: Slice
    interval: Interval


def metrics_of(
    stages: Sequence[AnyStage], scenes: Sequence[SceneResult]
) -> tuple[tuple[str, Metric], ...]:
    """Stage and metric of everything that was measured, the chain last."""
    found = [(stage.name, metric) for stage in stages for metric in stage.metrics]
    if any(scene.chain is not None for scene in scenes):
        found += [(CHAIN, metric) for metric in METRICS]
    return tuple(found)


def scene_value(scene: SceneResult, stage: str, metric: str) -> float | None:
    """One scene's value;

    None where it was not run, or is not defined there. "joint.average": a field of a field of the
    scores.
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
    """Every metric over every slice; what is defined on no scene of a slice is left out."""
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
