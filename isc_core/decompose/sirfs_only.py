"""Plain SIRFS: the whole photo is taken as diffuse, image = reflectance * shading.

Citation: J. T. Barron, J. Malik, "Shape, illumination, and reflectance from shading", TPAMI 2015,
doi:10.1109/TPAMI.2014.2377712.

Limits: highlights become pale paint, and bend the shape.
"""

from .layers import unseparated
from .shape import recover_shape
from .task import Answer, Task


def sirfs(task: Task) -> Answer:
    """Shape and light of the photo as it is. Raises `InputError`, `Cancelled`."""
    split, diffuse = unseparated(task)
    shape = recover_shape(diffuse, task, task.monitor.part(0.1, 0.95))
    return Answer(split, shape.height, shape.light, shape.status)
