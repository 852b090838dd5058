"""Input and output of every model."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..io.stage_cache import StageCache
from ..networks.scene_network import SceneNetwork, ScenePrediction
from ..photo import Photo
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..scene.diagnostics import Diagnostics
from ..scene.known_inputs import SceneConstraints
from ..scene.light_coefficients_estimate import LightCoefficientsEstimate
from ..scene.lobe_fit import LobeFit
from ..scene.normal_estimate import NormalEstimate
from ..scene.shading_estimate import ShadingEstimate
from ..sirfs.priors.prior_set import PriorSet
from ..sirfs.recover import MARGIN, SOLVE_SIZE
from ..sirfs.settings import BALANCED_LIGHT, LightColourWeight, PredictionWeights
from .settings import Settings


@dataclass
class Clock:
    """Seconds spent in each stage.

    Attributes
    ----------
    seconds : dict of str to float
        Seconds by stage, in the order in which the stages began.
    """

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the duration of the `with` block to the stage `name`.

        Parameters
        ----------
        name : str
            Key in `seconds`.

        Returns
        -------
        context manager
        """
        start = time.perf_counter()
        yield
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 4)


@dataclass(frozen=True)
class SolveOptions:
    """Options of the pipeline for protocols that differ from `decompose`'s defaults.

    None of it is a user's setting: the defaults are what every user runs. Evaluation under a
    published protocol sets the others, see `evaluation.runner`.

    Attributes
    ----------
    solve_size : int
        Long side of the object's box, pixels, at which SIRFS is solved; 0 for the working size. In
        the illuminations of MIT-Berkeley 224 at most, and larger objects are not reduced.
    margin : int
        Pixels of empty space around the box at that size.
    whole_frame : bool
        SIRFS is solved on the frame as given, not on a window around the object.
    drop_near_edge : bool
        Occluding-contour points near the frame are ignored.
    layer_dtype : type
        Floating-point type of the layers and of the shading that they are divided by.
    fit_lobe : bool
        A lobe is fitted to the specular layer.
    check_assumptions : bool
        The photo is checked against the models' assumptions, and the light's colour is estimated
        even where it is not used.
    scene_network : SceneNetwork or None
        The scene network; None for the shipped one.
    prediction_weights : PredictionWeights or None
        Weights of predicted normals, shading and light coefficients; None for those of the
        illumination.
    light_colour_weight : LightColourWeight
        Weight of the prior of white light, where it is used.
    """

    solve_size: int = SOLVE_SIZE
    margin: int = MARGIN
    whole_frame: bool = False
    drop_near_edge: bool = False
    layer_dtype: type[np.floating[Any]] = np.float32
    fit_lobe: bool = True
    check_assumptions: bool = True
    scene_network: SceneNetwork | None = None
    prediction_weights: PredictionWeights | None = None
    light_colour_weight: LightColourWeight = BALANCED_LIGHT


@dataclass(frozen=True, eq=False)
class DecompositionTask:
    """One photo to be decomposed.

    Attributes
    ----------
    working : Photo
        The photo at the scale at which shape and light are recovered.
    maps : Photo
        The photo at the scale of the result's maps; the same object where the two scales agree.
    settings : Settings
        The user's settings.
    known : SceneConstraints
        Known shape, light and depth at the working scale.
    prior_set : PriorSet or None
        SIRFS priors; None for the shipped set.
    monitor : Monitor
        Receives progress; can cancel.
    clock : Clock
        Receives the duration of each stage.
    split : Separation or None
        Layers of `maps` by the separator of the settings, where already computed; for the joint
        model by colour alone.
    prediction : ScenePrediction or None
        The scene network's prediction for the working photo, where already computed.
    normal_estimate : NormalEstimate or None
        Predicted normals at the working scale, where already computed; used in any light.
    shading_estimate : ShadingEstimate or None
        Predicted log shading at the working scale.
    light_coefficients : LightCoefficientsEstimate or None
        Predicted coefficients of the light.
    silhouette : (h, w) ndarray of bool or None
        Outline of the object in `working`; None where it is the working photo's mask.
    options : SolveOptions
        What a protocol changes in the pipeline.
    kept : StageCache or None
        Results of stages of earlier runs, to which those of this one are added.
    """

    working: Photo
    maps: Photo
    settings: Settings
    known: SceneConstraints = field(default_factory=SceneConstraints)
    prior_set: PriorSet | None = None
    monitor: Monitor = field(default_factory=Monitor)
    clock: Clock = field(default_factory=Clock)
    split: Separation | None = None
    prediction: ScenePrediction | None = None
    normal_estimate: NormalEstimate | None = None
    shading_estimate: ShadingEstimate | None = None
    light_coefficients: LightCoefficientsEstimate | None = None
    silhouette: np.ndarray | None = None
    options: SolveOptions = field(default_factory=SolveOptions)
    kept: StageCache | None = None

    @property
    def one_scale(self) -> bool:
        """Whether the maps have the working scale."""
        return self.maps is self.working


@dataclass(frozen=True, eq=False)
class SceneEstimate:
    """What a model recovers from a photo.

    Normals, shading and reflectance follow from height and light.

    Attributes
    ----------
    split : Separation
        Layers of `DecompositionTask.maps`, which sum to the image.
    height : (H, W) ndarray
        Pixels of the maps, toward the viewer.
    light : (9, 3) ndarray
        Log-shading SH coefficients, reference convention.
    diagnostics : Diagnostics
        How the solver ended, and what the checks found.
    brdf : LobeFit or None
        Lobe fitted to the specular layer; None where there is no such layer.
    log_shading : (h, w, 3) ndarray or None
        A baseline's own log shading at the working scale, where it has one. The maps of a result
        never use it, since their shading is that of the light on the normals.
    prediction : ScenePrediction or None
        The scene network's prediction for the working photo, where it was run.
    """

    split: Separation
    height: np.ndarray
    light: np.ndarray
    diagnostics: Diagnostics
    brdf: LobeFit | None = None
    log_shading: np.ndarray | None = None
    prediction: ScenePrediction | None = None
