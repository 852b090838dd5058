"""The models: how separation, shape and light are joined to explain one photo. One model a file,
and one function that knows their names.

A model is a function from a `Task` to an `Answer`: `plain.sirfs`, `mdr.mdr`, `mbp.mbp`,
`joint.joint`, and the `baselines` to compare with. Of those that separate, `light_colour` decides
which colour of light they see; those that find shape and light are told how the light and the shape
look (`lamp_network`, `shape_network`), and of what they find `doubts` looks whether the photo shows
what they assume.
"""

from dataclasses import replace

from ..imaging.framing import is_cut
from ..networks.light_network import predict_light
from ..networks.normal_network import predict_normals
from ..scene.normal_estimate import NormalEstimate
from .assumption_checks import with_warnings
from .baseline import baseline
from .joint import joint
from .light_colour import under_light
from .mbp import mbp
from .mdr import mdr
from .settings import SEPARATING_MODELS, SIRFS_MODELS, Settings
from .sirfs_only import sirfs
from .task import Answer, Task

_SOLVERS = {"mdr": mdr, "mbp": mbp, "joint": joint, "sirfs": sirfs}


def solve(task: Task) -> Answer:
    """What the model that `task.settings` names makes of the photo.

    Raises `InputError`, `Cancelled`.
    """
    solver = _SOLVERS.get(task.settings.model, baseline)
    if task.settings.model not in SIRFS_MODELS:
        return solver(task)
    light_estimate = task.light_estimate
    if light_estimate is None:
        with task.clock.stage("light at first sight"):
            light_estimate = predict_light(task.maps.image, task.maps.mask)
    task = replace(task, light_estimate=light_estimate, seen=_seen_shape(task))
    answer = under_light(task, solver) if task.settings.model in SEPARATING_MODELS else solver(task)
    return with_warnings(task.maps, answer, light_estimate)


def _seen_shape(task: Task) -> NormalEstimate | None:
    """What was seen of the shape;

    None where that is not asked for, a depth tells more, or the frame cuts the object.
    """
    if (
        not task.settings.looks_at_shape
        or task.known.depth is not None
        or is_cut(task.working.mask)
    ):
        return None
    if task.seen is not None:
        return task.seen
    with task.clock.stage("shape at first sight"):
        return predict_normals(task.working.image, task.working.mask)


__all__ = ["Answer", "Settings", "Task", "solve"]
