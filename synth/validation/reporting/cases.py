"""The best, median and worst scene of each stage, run again for their pictures and maps, so that
these need not be kept for all scenes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.io.exr import write_channels
from isc_core.progress import Monitor

from ...capture.truth import GroundTruth
from ...dataset.reading import read_truth
from ..measurement.bounds import Verdict
from ..measurement.figures import CHAIN, Figure, scene_value
from ..measurement.measure import SceneResult, ValidationOptions, side_by_side
from ..measurement.substitution import METRICS
from ..stages.separation import SEPARATION
from ..stages.sirfs import SIRFS
from ..stages.types import AnyStage, Metric, StagePicture, stage_inputs
from .formatting import number

_RANKS = ("best", "median", "worst")


@dataclass(frozen=True)
class ValidationCase:
    """A scene of the report.

    Attributes
    ----------
    stage, rank : str
        The stage, and "best", "median" or "worst".
    scene, remark : str
        Name of the scene, and its error and properties.
    pictures : tuple of StagePicture
        Ground truth and result.
    """

    stage: str
    rank: str
    scene: str
    remark: str
    pictures: tuple[StagePicture, ...]


@dataclass(frozen=True)
class _Place:
    """A scene to show: the stage (or "chain"), the metric that ranks it, its rank and value."""

    stage: str
    metric: Metric
    rank: str
    scene: SceneResult
    value: float


def make_cases(
    scenes: Sequence[SceneResult], options: ValidationOptions, monitor: Monitor
) -> tuple[ValidationCase, ...]:
    """Run the scenes of the report again, for their pictures.

    Parameters
    ----------
    scenes : sequence of SceneResult
        The scenes that could be run.
    options : ValidationOptions
        The options of the run.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    tuple of ValidationCase
        For the chain, if it was run, and every stage, ranked by its first metric.

    Raises
    ------
    InputError
        If a scene cannot be read.
    Cancelled
        If the user cancels.
    """
    ranked = [(stage.name, stage.metrics[0]) for stage in options.stages]
    if any(scene.chain is not None for scene in scenes):
        ranked.append((CHAIN, METRICS[0]))
    places = [place for stage, metric in ranked for place in _places(stage, metric, scenes)]

    def run(place: _Place, own: Monitor) -> ValidationCase:
        truth, facts = read_truth(place.scene.facts.folder), place.scene.facts
        kind = f"{facts.gloss_class} {facts.model}, {facts.albedo}, light {facts.light_kind}"
        share = f"{100 * facts.specular_share:.1f} % specular light"
        remark = f"{place.metric.title} {number(place.value)}; {kind}; {share}"
        pictures = (
            _chain_pictures(truth, options, own)
            if place.stage == CHAIN
            else _stage_pictures(place.stage, truth, options, own)
        )
        return ValidationCase(place.stage, place.rank, facts.name, remark, pictures)

    return side_by_side(run, places, options.threads, "drawing", monitor) if places else ()


def _stage_pictures(
    name: str, truth: GroundTruth, options: ValidationOptions, monitor: Monitor
) -> tuple[StagePicture, ...]:
    stage = next(stage for stage in options.stages if stage.name == name)
    return stage.show(truth, stage.run(stage_inputs(truth, stage.needs), options.settings, monitor))


def _chain_pictures(
    truth: GroundTruth, options: ValidationOptions, monitor: Monitor
) -> tuple[StagePicture, ...]:
    """Shape and light estimated from the photo, with the diffuse layers next to the photo."""
    split = SEPARATION.run(stage_inputs(truth, ()), options.settings, monitor)
    answer = SIRFS.run(stage_inputs(truth, (), split.diffuse), options.settings, monitor)
    photo, *rest = SIRFS.show(truth, answer)
    layers = [
        picture
        for picture in SEPARATION.show(truth, split)
        if picture.caption.startswith("diffuse")
    ]
    return (photo, *layers, *rest)


def worst_scenes(
    verdict: Verdict, figures: Sequence[Figure], scenes: Sequence[SceneResult], many: int = 2
) -> tuple[SceneResult, ...]:
    """Return the scenes of a bound's slice with the largest errors.

    Parameters
    ----------
    verdict : Verdict
        The bound.
    figures : sequence of Figure
        All figures.
    scenes : sequence of SceneResult
        The scenes that the figures refer to.
    many : int, optional
        How many to return.

    Returns
    -------
    tuple of SceneResult
        The worst first.
    """
    bound = verdict.bound
    figure = next(
        f for f in figures if (f.stage, f.metric.name, f.group.kind, f.group.value) == _key(verdict)
    )
    values = [
        (value, k)
        for k in figure.group.members
        if (value := scene_value(scenes[k], bound.stage, bound.metric)) is not None
    ]
    ordered = sorted(values, reverse=not figure.metric.larger_is_better)
    return tuple(scenes[k] for _, k in ordered[:many])


def write_evidence(
    folder: Path, scene: SceneResult, stage: str, options: ValidationOptions, monitor: Monitor
) -> tuple[str, ...]:
    """Write the true and the estimated maps of one scene.

    Parameters
    ----------
    folder : Path
        Receives `truth.exr` and `STAGE.exr`; for the chain, one file per stage.
    scene : SceneResult
        The scene.
    stage : str
        The stage, or "chain".
    options : ValidationOptions
        The options of the run.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    tuple of str
        Names of the files.

    Raises
    ------
    InputError
        If the scene cannot be read or a file cannot be written.
    Cancelled
        If the user cancels.
    """
    truth = read_truth(scene.facts.folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_channels(folder / "truth.exr", _truth_maps(truth))
    names = ["truth.exr"]
    diffuse = None
    stages: tuple[AnyStage, ...] = (SEPARATION, SIRFS)
    for found in stages if stage == CHAIN else (own for own in options.stages if own.name == stage):
        inputs = stage_inputs(truth, () if stage == CHAIN else found.needs, diffuse)
        answer = found.run(inputs, options.settings, monitor)
        diffuse = getattr(answer, "diffuse", diffuse)
        name = f"{'chain_' if stage == CHAIN else ''}{found.name}.exr"
        write_channels(folder / name, found.maps(answer))
        names.append(name)
    return tuple(names)


def _key(verdict: Verdict) -> tuple[str, str, str, str]:
    bound = verdict.bound
    return bound.stage, bound.metric, bound.kind, bound.value


def _places(stage: str, metric: Metric, scenes: Sequence[SceneResult]) -> list[_Place]:
    values = [
        (value, k)
        for k, scene in enumerate(scenes)
        if (value := scene_value(scene, stage, metric.name)) is not None
    ]
    ordered = sorted(values, reverse=metric.larger_is_better)
    if not ordered:
        return []
    picks = dict.fromkeys((0, len(ordered) // 2, len(ordered) - 1))
    ranks = _RANKS if len(picks) == 3 else _RANKS[::2][: len(picks)]
    return [
        _Place(stage, metric, rank, scenes[ordered[pick][1]], ordered[pick][0])
        for rank, pick in zip(ranks, picks, strict=True)
    ]


def _truth_maps(truth: GroundTruth) -> dict[str, np.ndarray]:
    maps = {
        name: values
        for name, values in truth.arrays().items()
        if values.shape[:2] == truth.mask.shape
    }
    letters = {2: ("Y",), 3: ("R", "G", "B")}
    return {
        f"{name}.{letter}": np.asarray(values, np.float32).reshape(*truth.mask.shape, -1)[..., k]
        for name, values in maps.items()
        for k, letter in enumerate(letters[values.ndim])
    }
