"""The models: how separation, shape and light are joined to explain one photo. One model a file, and one function that knows their names.

A model is a function from a `Task` to an `Answer`: `plain.sirfs`, `mdr.mdr`, `mbp.mbp`, `joint.joint`, and the `baselines` to compare with.
Of those that separate, `light_colour` decides which colour of light they see; those that find shape and light are told how the light
and the shape look (`lamp_network`, `shape_network`), and of what they find `doubts` looks whether the photo shows what they assume.
"""

from dataclasses import replace

from ..lamp_network import glance_at
from ..shape_network import shape_at
from ..sirfs.framing import is_cut
from .baseline import baseline
from .doubts import doubted
from .joint import joint
from .light_colour import under_light
from .mbp import mbp
from .mdr import mdr
from .plain import sirfs
from .settings import SEPARATING_MODELS, SIRFS_MODELS, Settings
from .task import Answer, Task

_SOLVERS = {"mdr": mdr, "mbp": mbp, "joint": joint, "sirfs": sirfs}


def solve(task: Task) -> Answer:
    """What the model that `task.settings` names makes of the photo. Raises `InputError`, `Cancelled`."""
    solver = _SOLVERS.get(task.settings.model, baseline)
    if task.settings.model not in SIRFS_MODELS:
        return solver(task)
    glance, seen = task.glance, task.seen
    if glance is None:
        with task.clock.stage("light at first sight"):
            glance = glance_at(task.maps.image, task.maps.mask)
    if seen is None and task.settings.looks_at_shape and task.known.depth is None and not is_cut(task.working.mask):
        with task.clock.stage("shape at first sight"):
            seen = shape_at(task.working.image, task.working.mask)
    task = replace(task, glance=glance, seen=seen)
    answer = under_light(task, solver) if task.settings.model in SEPARATING_MODELS else solver(task)
    return doubted(task.maps, answer, glance)


__all__ = ["Answer", "Settings", "Task", "solve"]
