"""Plain SIRFS: the whole photo is taken as diffuse.

Equation: image = reflectance * shading.

Citation: J. T. Barron, J. Malik, "Shape, illumination, and reflectance from shading", TPAMI 2015,
doi:10.1109/TPAMI.2014.2377712.

Limits: highlights become pale albedo and distort the shape.
"""

from .layers import unseparated
from .shape import recover_shape
from .task import DecompositionTask, SceneEstimate


def sirfs(task: DecompositionTask) -> SceneEstimate:
    """Recover shape and light of the photo as it is.

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
        If the known quantities do not fit.
    Cancelled
        If the monitor cancels.
    """
    split, diffuse = unseparated(task)
    shape = recover_shape(diffuse, task, task.monitor.part(0.1, 0.95))
    return SceneEstimate(split, shape.height, shape.light, shape.diagnostics)
