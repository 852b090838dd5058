"""The baselines as models: the whole photo is taken as diffuse, and one direct method gives shape
and light.
"""

import numpy as np

from .. import baselines
from .layers import unseparated
from .shape import height_of_maps
from .task import Answer, Task


def baseline(task: Task) -> Answer:
    """What the baseline named in the settings makes of the photo.

    Raises `InputError`, `Cancelled`.
    """
    name, working = task.settings.model, task.working
    split, diffuse = unseparated(task)
    task.monitor.report(f"shape and light ({name})", 0.1)
    with task.clock.stage("shape and light"):
        floor = max(working.code_value / 2, float(np.finfo(diffuse.dtype).tiny))
        log_image = np.log(np.maximum(np.where(working.mask[..., None], diffuse, 1), floor))
        guess = baselines.estimate(name, log_image, working.mask)
    status = {"converged": True, "reason": "direct method"}
    return Answer(split, height_of_maps(guess.height, task), guess.light, status)
