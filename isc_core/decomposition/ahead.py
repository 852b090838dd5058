"""Work that does not wait for the scene network, on threads of its own while the network runs.

Problem: a photo is looked at by a network, separated by colour, and solved by kernels that have to
be loaded, one after the other, though none of the three needs another.

Equation: separation by colour and the loading of kernels begin first; the results are those of the
same functions, whenever they run.

Limits: the light's colour, where it is to be estimated, changes the photo that is separated: then
only the kernels are loaded ahead. Python lets one thread at a time interpret: what overlaps are the
array operations.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from types import TracebackType

from ..progress import Monitor
from ..scene.decomposition import Separation
from ..sirfs.kernel_cache import load_kernels
from .layers import separated
from .settings import SEPARATING_MODELS, LightColour
from .task import DecompositionTask


class Ahead:
    """Work for a task that begins with the `with` block, and ends with it at the latest.

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
        if settings.engine != "numpy" and task.prior_set is None:
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
        return task if self._split is None else replace(task, split=self._split.result())

    def __enter__(self) -> "Ahead":
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
        return separated(task.maps, task.settings.separator, monitor, task.options.layer_dtype)
