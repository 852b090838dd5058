"""The models: how separation, shape and light are combined to explain one photo. One model a file,
and one function that knows their names.

A model is a function from a `DecompositionTask` to a `SceneEstimate`: `sirfs_only.sirfs`,
`mdr.mdr`, `mbp.mbp`, `joint.joint`, and the `baselines` to compare with. `toning` makes toned
photos grey, `light_colour` decides which colour of light they see; those that recover shape and
light are given what a network sees in the photo (`predictions`), and `assumption_checks` lowers the
confidence of photos that violate what the models assume.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from .ahead import Ahead
from .assumption_checks import with_warnings
from .detail import with_fine_relief
from .light_colour import under_given_light, under_light
from .predictions import with_predictions
from .settings import SIRFS_MODELS, Settings
from .task import DecompositionTask, SceneEstimate, SolveOptions
from .toning import under_tone


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
    lit = partial(under_given_light, solver=partial(_solved, solver=solver))
    return under_tone(task, lit)


def _solved(
    task: DecompositionTask, solver: Callable[[DecompositionTask], SceneEstimate]
) -> SceneEstimate:
    """Predict, solve and check."""
    with Ahead(task) as ahead:
        task = with_predictions(task)
        estimate = under_light(task, lambda lit: solver(ahead.added(lit)))
    estimate = replace(estimate, prediction=task.prediction)
    estimate = with_fine_relief(task, estimate)
    if task.prediction is None or not task.options.check_assumptions:
        return estimate
    return with_warnings(task.maps, estimate, task.prediction)


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


__all__ = ["DecompositionTask", "SceneEstimate", "Settings", "SolveOptions", "solve"]
