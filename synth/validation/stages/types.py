"""Types shared by all stages of a validation: inputs, options, metrics and the stage itself.

A stage is one step from photo to scene. Its inputs are the results of the preceding stages, or
their ground truth if it is measured in isolation. A new stage needs a module with its `run`,
`score`, `show` and `maps`, and an entry in `registry.all_stages`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

import numpy as np

from isc_core.decomposition.pipeline import ILLUMINATIONS
from isc_core.decomposition.settings import SEPARATING_MODELS
from isc_core.errors import InputError
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from isc_core.separation import BEST, METHODS

from ...capture.truth import GroundTruth

# Which ground truth can replace an estimate of the chain.
Truth = Literal["diffuse", "shape", "light"]

# Values below half a 16-bit code are treated as black: neither colour nor shape is defined there.
BLACK = 0.5 / 65535


@dataclass(frozen=True)
class StageOptions:
    """Options of all stages.

    Attributes
    ----------
    separator : str
        One of `isc_core.separation.METHODS`.
    illumination : str
        One of `isc_core.decomposition.pipeline.ILLUMINATIONS`.
    threads : int
        Threads of one solver, 0 for all cores.
    models : tuple of str
        Which of `SEPARATING_MODELS` the stage "models" compares with plain SIRFS.

    Raises
    ------
    InputError
        For an unknown name.
    """

    separator: str = BEST
    illumination: str = "photo"
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


@dataclass(frozen=True, eq=False)
class StageInputs:
    """The inputs of a stage.

    Attributes
    ----------
    image : (H, W, 3) ndarray
        The photo, linear Rec.709.
    mask, clipped : (H, W) ndarray of bool
        The object, and its clipped pixels.
    diffuse : (H, W, 3) ndarray or None
        True or estimated diffuse layer.
    height : (H, W) ndarray or None
        True height in pixels toward the viewer.
    light : (9, 3) ndarray or None
        True light, log-shading coefficients in the camera frame.
    split : Separation or None
        Result of the stage "separation", None if it was not run.
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
    """One error measure of a stage.

    Attributes
    ----------
    name : str
        Field of the stage's scores.
    title, unit : str
        As the report shows them.
    geometric : bool
        Averaged over scenes by the geometric mean, for errors that span orders of magnitude;
        otherwise by the arithmetic mean.
    larger_is_better : bool
        Direction of the metric.
    margin : float
        Distance of an updated bound from the measured interval: relative for geometric means,
        otherwise in the metric's unit.
    given_by : tuple of str
        Ground truths that define the result, so that the metric is meaningless under them.
    """

    name: str
    title: str
    unit: str = ""
    geometric: bool = True
    larger_is_better: bool = False
    margin: float = 0.1
    given_by: tuple[Truth, ...] = ()


@dataclass(frozen=True, eq=False)
class StagePicture:
    """One map of the report: a caption, and colours (H, W, 3) in sRGB encoding, [0, 1]."""

    caption: str
    colors: np.ndarray


Answer = TypeVar("Answer")
Scored = TypeVar("Scored")


@dataclass(frozen=True, eq=False)
class Stage(Generic[Answer, Scored]):
    """One step from photo to scene, with its error measures.

    Attributes
    ----------
    name, title : str
        Names in options and report.
    needs : tuple of str
        Ground truths that the stage gets when it is measured in isolation.
    metrics : tuple of Metric
        The first one ranks scenes.
    run : callable
        ``run(inputs, options, monitor)`` returns the stage's answer. Raises `InputError` if the
        stage cannot process the photo.
    score : callable
        ``score(truth, answer)`` returns a dataclass with one field per metric, None where it is
        undefined.
    show : callable
        ``show(truth, answer)`` returns pictures of truth and answer, in pairs.
    maps : callable
        ``maps(answer)`` returns the channels of an EXR file.
    """

    name: str
    title: str
    needs: tuple[Truth, ...]
    metrics: tuple[Metric, ...]
    run: Callable[[StageInputs, StageOptions, Monitor], Answer]
    score: Callable[[GroundTruth, Answer], Scored]
    show: Callable[[GroundTruth, Answer], tuple[StagePicture, ...]]
    maps: Callable[[Answer], Mapping[str, np.ndarray]]

    def metric(self, name: str) -> Metric:
        """Return a metric by name.

        Parameters
        ----------
        name : str
            Name of the metric.

        Returns
        -------
        Metric
            The metric.

        Raises
        ------
        InputError
            For an unknown name.
        """
        for metric in self.metrics:
            if metric.name == name:
                return metric
        known = ", ".join(metric.name for metric in self.metrics)
        raise InputError(f"the stage {self.name} has no metric {name!r}: choose {known}")


AnyStage = Stage[Any, Any]


def stage_inputs(
    truth: GroundTruth, truths: tuple[Truth, ...], diffuse: np.ndarray | None = None
) -> StageInputs:
    """Return the inputs of a stage for a scene under the given ground truths.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    truths : tuple of str
        The ground truths that replace estimates.
    diffuse : (H, W, 3) ndarray, optional
        Estimated diffuse layer, used unless "diffuse" is among `truths`.

    Returns
    -------
    StageInputs
        The inputs.
    """
    mask = truth.mask
    # A sensor clips at exactly 1; above it, the photo was rendered without clipping.
    clipped = mask & (truth.image == 1).any(axis=2)
    return StageInputs(
        truth.image,
        mask,
        clipped,
        diffuse=truth.diffuse if "diffuse" in truths else diffuse,
        height=truth.height if "shape" in truths else None,
        light=truth.illumination if "light" in truths else None,
    )
