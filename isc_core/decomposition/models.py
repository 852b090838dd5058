"""The models: how separation, shape and light are combined to explain one photo. One model a file,
and one function that knows their names.

A model is a function from a `DecompositionTask` to a `SceneEstimate`: `sirfs_only.sirfs`,
`mdr.mdr`, `mbp.mbp`, `joint.joint`, and the `baselines` to compare with. `light_colour` decides
which colour of light the separating models see; those that recover shape and light are given the
predicted light and normals (`networks.light_network`, `networks.normal_network`), and
`assumption_checks` lowers the confidence of photos that violate what the models assume.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..imaging.framing import is_cut
from ..networks.light_network import predict_light
from ..networks.normal_network import predict_normals
from ..scene.light_estimate import LightEstimate
from ..scene.normal_estimate import NormalEstimate
from .assumption_checks import with_warnings
from .light_colour import under_light
from .settings import SEPARATING_MODELS, SIRFS_MODELS, Settings
from .task import DecompositionTask, SceneEstimate, SolveOptions


def solve(task: DecompositionTask) -> SceneEstimate:
    """Run the model that the settings name.

    This is the one pipeline: `decompose` and every evaluation call it.

    Parameters
    ----------
    task : DecompositionTask
        The photo, the settings, and what a protocol changes.

    Returns
    -------
    SceneEstimate
        Layers, height and light.

    Raises
    ------
    InputError
        If the model cannot explain this photo.
    Cancelled
        If the monitor cancels.
    """
    solver = _solver(task.settings.model)
    if task.settings.model not in SIRFS_MODELS:
        return solver(task)
    light_estimate = _light_estimate(task)
    task = replace(task, light_estimate=light_estimate, normal_estimate=_normal_estimate(task))
    estimate = (
        under_light(task, solver) if task.settings.model in SEPARATING_MODELS else solver(task)
    )
    if light_estimate is None or not task.options.check_assumptions:
        return estimate
    with task.clock.stage("check assumptions"):
        return with_warnings(task.maps, estimate, light_estimate)


def _solver(model: str) -> Callable[[DecompositionTask], SceneEstimate]:
    """The function of a model; only its module is imported."""
    match model:
        case "joint":
            from .joint import joint

            return joint
        case "mdr":
            from .mdr import mdr

            return mdr
        case "mbp":
            from .mbp import mbp

            return mbp
        case "sirfs":
            from .sirfs_only import sirfs

            return sirfs
        case _:
            from .baseline import baseline

            return baseline


def _light_estimate(task: DecompositionTask) -> LightEstimate | None:
    """The predicted light; None where no step uses it."""
    settings, options = task.settings, task.options
    used = options.check_assumptions or options.fit_lobe or settings.uses_predicted_light
    if task.light_estimate is not None or not used:
        return task.light_estimate
    with task.clock.stage("predict light"):
        return predict_light(task.maps.image.astype(np.float32, copy=False), task.maps.mask)


def _normal_estimate(task: DecompositionTask) -> NormalEstimate | None:
    """The predicted normals: those given; else None where the settings exclude them, a depth is
    known, or the frame cuts the object.
    """
    if task.normal_estimate is not None:
        return task.normal_estimate
    if (
        not task.settings.uses_predicted_normals
        or task.known.depth is not None
        or is_cut(task.working.mask)
    ):
        return None
    with task.clock.stage("predict normals"):
        return predict_normals(task.working.image.astype(np.float32, copy=False), task.working.mask)


__all__ = ["DecompositionTask", "SceneEstimate", "Settings", "SolveOptions", "solve"]
