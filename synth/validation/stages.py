"""The stages that are validated, and what all of them have in common.

A stage is one step from photo to scene: it sees what the stages before it found, or the truth of
that where it is measured by itself. Adding one: a file with its `run`, `score` and `shown`, and an
entry in `all_stages`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

import numpy as np

from isc_core.decomposition import Separation
from isc_core.errors import InputError
from isc_core.models.settings import SEPARATING_MODELS
from isc_core.pipeline import ILLUMINATIONS
from isc_core.progress import Monitor
from isc_core.separation import BEST, METHODS

from ..truth import GroundTruth

Truth = Literal[
    "diffuse", "shape", "light"
]  # what can be swapped in for what a stage would have to find

# Darker than half a code of 16 bits is black: no colour and no shape can be read there.
BLACK = 0.5 / 65535


@dataclass(frozen=True)
class StageOptions:
    """`separator`: one of `isc_core.separation.METHODS`. `illumination`: "natural" or "laboratory",
    which lights SIRFS expects. `threads`: of one solver, 0 for all cores. `models`: which of
    `SEPARATING_MODELS` the stage "models" compares with plain SIRFS. Raises `InputError` for
    unknown names.
    """

    separator: str = BEST
    illumination: str = "natural"
    threads: int = 1
    models: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        given = [
            ("separator", self.separator, METHODS),
            ("illumination", self.illumination, ILLUMINATIONS),
        ]
        given += [("model", model, SEPARATING_MODELS) for model in self.models]
        for name, value, known in given:
            if value not in known:
                raise InputError(f'unknown {name} "{value}": choose {", ".join(known)}')


@dataclass(frozen=True)
class Inputs:
    """What a stage sees.

    `image`: (H, W, 3) linear, the photo; `mask`, `clipped`: (H, W) bool. `diffuse`: (H, W, 3), the
    diffuse layer as it is believed to be, None before it is known. `height` (H, W) pixels and
    `light` (9, 3) in our convention: given as exact, or None. `split`: the layers that the stage
    "separation" found, None where it was not run.
    """

    image: np.ndarray
    mask: np.ndarray
    clipped: np.ndarray
    diffuse: np.ndarray | None = None
    height: np.ndarray | None = None
    light: np.ndarray | None = None
    split: Separation | None = None


@dataclass(frozen=True)
class Metric:
    """One figure of a stage.

    `name`: the field of the stage's scores. `title`, `unit`: for people. `geometric`: how it is
    averaged over scenes, as errors that span powers of ten are; else by the plain mean.
    `larger_is_better`. `margin`: how far a bound that is taken from a run lies from it, as a share
    of the value where the mean is geometric, else in the metric's unit. `given_by`: truths that
    hand the answer over.
    """

    name: str
    title: str
    unit: str = ""
    geometric: bool = True
    larger_is_better: bool = False
    margin: float = 0.1
    given_by: tuple[Truth, ...] = ()


@dataclass(frozen=True)
class Picture:
    """One map to look at: a caption and colours (H, W, 3), coded as sRGB, in [0, 1]."""

    caption: str
    colors: np.ndarray


Answer = TypeVar("Answer")
Marks = TypeVar("Marks")


@dataclass(frozen=True)
class Stage(Generic[Answer, Marks]):
    """`title`: for people. `needs`: the truths that a stage measured by itself is given. `metrics`:
    the first one ranks scenes.

    `run(inputs, options, monitor)` finds an answer and raises `InputError` where it can do nothing
    with the photo. `score(truth, answer)` gives a dataclass with a field for each metric, None
    where it is not defined. `shown(truth, answer)` gives pictures of truth and answer, in pairs.
    `maps(answer)` the channels of an EXR file.
    """

    name: str
    title: str
    needs: tuple[Truth, ...]
    metrics: tuple[Metric, ...]
    run: Callable[[Inputs, StageOptions, Monitor], Answer]
    score: Callable[[GroundTruth, Answer], Marks]
    shown: Callable[[GroundTruth, Answer], tuple[Picture, ...]]
    maps: Callable[[Answer], Mapping[str, np.ndarray]]

    def metric(self, name: str) -> Metric:
        """A metric by name. Raises `InputError` for an unknown one."""
        for metric in self.metrics:
            if metric.name == name:
                return metric
        raise InputError(
            f"the stage {self.name} has no metric {name!r}: choose {', '.join(metric.name for metric in self.metrics)}"
        )


def all_stages() -> tuple[Stage[Any, Any], ...]:
    """Every stage that is run if nothing else is said, in the order of the chain."""
    from .lobe_stage import GLOSS
    from .separation_stage import SEPARATION
    from .sirfs_stage import SIRFS

    return SEPARATION, SIRFS, GLOSS


def find_stages(names: tuple[str, ...] | None) -> tuple[Stage[Any, Any], ...]:
    """Stages by name, in the order of the chain; all of them for None.

    Raises `InputError` for an unknown name.
    """
    stages = all_stages()
    known = [stage.name for stage in stages]
    if unknown := [name for name in names or () if name not in known]:
        raise InputError(f"unknown stage {unknown[0]!r}: choose {', '.join(known)}")
    return tuple(stage for stage in stages if names is None or stage.name in names)


def given(
    truth: GroundTruth, truths: tuple[Truth, ...], diffuse: np.ndarray | None = None
) -> Inputs:
    """What a stage sees of a scene when `truths` are handed over;

    `diffuse`: what the separation found, where its truth is not.
    """
    mask = truth.mask
    clipped = mask & (truth.image >= 1).any(axis=2) & (truth.residual < 0).any(axis=2)
    return Inputs(
        truth.image,
        mask,
        clipped,
        diffuse=truth.diffuse if "diffuse" in truths else diffuse,
        height=truth.height if "shape" in truths else None,
        light=truth.illumination if "light" in truths else None,
    )
