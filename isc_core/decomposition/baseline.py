"""The baselines as models: the whole photo is taken as diffuse, and one direct method recovers
shape and light.
"""

import numpy as np

from .. import baselines
from ..scene.diagnostics import Diagnostics, StopReason
from .layers import unseparated
from .shape import height_of_maps
from .task import DecompositionTask, SceneEstimate


def baseline(task: DecompositionTask) -> SceneEstimate:
    """Run the baseline that the settings name.

    Parameters
    ----------
    task : DecompositionTask
        The photo and the settings.

    Returns
    -------
    SceneEstimate
        Without a specular layer.

    Raises
    ------
    InputError
        If the baseline cannot use this photo.
    Cancelled
        If the monitor cancels.
    """
    name, working = task.settings.model, task.working
    split, diffuse = unseparated(task)
    task.monitor.report(f"shape and light ({name})", 0.1)
    with task.clock.stage("shape and light"):
        floor = max(working.code_value / 2, float(np.finfo(diffuse.dtype).tiny))
        log_image = np.log(np.maximum(np.where(working.mask[..., None], diffuse, 1), floor))
        guess = baselines.estimate(name, log_image, working.mask)
    direct = Diagnostics(converged=True, reason=StopReason.DIRECT)
    height = height_of_maps(guess.height, task)
    return SceneEstimate(split, height, guess.light, direct, log_shading=guess.log_shading)
