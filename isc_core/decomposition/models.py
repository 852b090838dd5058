"""The models: how separation, shape and light are combined to explain one photo. One model per
file, and one function that looks them up by name.

A model is a function from a `DecompositionTask` to a `SceneEstimate`: `sirfs_only.sirfs`,
`mdr.mdr`, `mbp.mbp`, `joint.joint`, and the `baselines` to compare with. `toning` makes toned
photos grey, `light_colour` divides the light's colour out; those that recover shape and light use
the predictions of a network (`predictions`), and `assumption_checks` lowers the confidence of
photos that violate what the models assume.

The network, the separation by colour and the loading of kernels are independent of each other and
run on threads; `load` begins while the photo is read. The order does not affect results.

Limits: where the light's colour is to be estimated, it changes the photo that is separated, which
then waits. Python interprets one thread at a time: what overlaps are array operations.
"""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from types import TracebackType

from ..io.memory import LARGE_PHOTO, release_memory
from ..networks.scene_network import SceneNetwork
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..sirfs.kernel_cache import load_kernels
from ..sirfs.priors.prior_set import PriorSet
from .assumption_checks import with_warnings
from .detail import with_fine_relief
from .layers import separated
from .light_colour import solve_under_estimated_light, solve_under_given_light
from .predictions import with_predictions
from .settings import SEPARATING_MODELS, SIRFS_MODELS, LightColour, Settings
from .task import DecompositionTask, SceneEstimate, SolveOptions
from .toning import is_grey, solve_toned


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
    lit = partial(solve_under_given_light, solver=partial(_solved, solver=solver))
    return solve_toned(task, lit)


def load(settings: Settings, prior_set: PriorSet | None = None) -> None:
    """Load the resources of a model, which `solve` does otherwise: a program can do it on a thread
    while it reads the photo. `solve` waits for what is being loaded; if loading fails, it tries
    again, and raises the error.

    Parameters
    ----------
    settings : Settings
        That name the model.
    prior_set : PriorSet, optional
        As for `decompose`: the shipped priors are not loaded if it is given.
    """
    _solver(settings.model)
    if settings.model not in SIRFS_MODELS:
        return
    SceneNetwork.shipped()
    if settings.engine != "numpy" and prior_set is None:
        load_kernels(settings.illumination)


def _solved(
    task: DecompositionTask, solver: Callable[[DecompositionTask], SceneEstimate]
) -> SceneEstimate:
    """Predict, solve and check."""
    with _BackgroundWork(task) as ahead:
        task = with_predictions(task)
        estimate = solve_under_estimated_light(task, lambda lit: solver(ahead.added(lit)))
    estimate = replace(estimate, prediction=task.prediction)
    if task.maps.mask.size > LARGE_PHOTO:
        release_memory()
    estimate = with_fine_relief(task, estimate)
    if task.prediction is None or not task.options.check_assumptions:
        return estimate
    return with_warnings(task.maps, estimate, task.prediction)


class _BackgroundWork:
    """Separation and loading of kernels on threads, during a `with` block.

    Parameters
    ----------
    task : DecompositionTask
    """

    def __init__(self, task: DecompositionTask) -> None:
        self._pool = ThreadPoolExecutor(2)
        settings = task.settings
        self._split: Future[Separation] | None = None
        separates = settings.model in SEPARATING_MODELS and task.split is None
        if separates and settings.light_colour != LightColour.ESTIMATE:
            self._split = self._pool.submit(_separated, task)
        self._kernels: Future[None] | None = None
        if settings.engine != "numpy" and task.prior_set is None and not is_grey(task.maps):
            self._kernels = self._pool.submit(load_kernels, settings.illumination)

    def added(self, task: DecompositionTask) -> DecompositionTask:
        """Return the task with the layers that were separated ahead; waits for all the work.

        Parameters
        ----------
        task : DecompositionTask
            As this one's, or with predictions.

        Returns
        -------
        DecompositionTask

        Raises
        ------
        InputError
            If the method cannot separate this photo.
        Cancelled
            If the monitor cancels.
        """
        if self._kernels is not None:
            self._kernels.result()
        split, self._split = self._split, None  # it is not kept while the task is solved
        return task if split is None else replace(task, split=split.result())

    def __enter__(self) -> "_BackgroundWork":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pool.shutdown(cancel_futures=True)


def _separated(task: DecompositionTask) -> Separation:
    """The layers of the maps' photo; progress is reported by the thread that waits."""
    with task.clock.stage("separation"):
        monitor = Monitor(cancelled=task.monitor.cancelled)
        settings, dtype = task.settings, task.options.layer_dtype
        by_colour = settings.separates_by_colour
        return separated(task.maps, settings.separator, monitor, dtype, by_colour=by_colour)


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


__all__ = ["DecompositionTask", "SceneEstimate", "Settings", "SolveOptions", "load", "solve"]
