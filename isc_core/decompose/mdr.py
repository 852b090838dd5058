"""Modified Dichromatic Reflectance: the specular light is separated first, SIRFS sees the diffuse
image.

Equation: image = reflectance * shading + specular.

Citation: H. Akbar, "3D Intrinsic Scene Characteristics Extraction Framework for a Single Image"
(2016; no DOI); the dichromatic model: S. A. Shafer 1985, doi:10.1002/col.5080100409.

With `Settings.confidence_weights` a pixel counts in SIRFS' terms of reflectance by the separation's
confidence (`sirfs.reflectance`).

Limits: what the separation leaves or takes too much of, SIRFS believes.
"""

from .layers import separated_first
from .lobe import fit_specular
from .shape import recover_shape, trust_of
from .task import Answer, Task


def mdr(task: Task) -> Answer:
    """Separation, then shape and light of the diffuse image, then the lobe of the specular one.

    Raises `InputError`, `Cancelled`.
    """
    split, working = separated_first(task)
    trust = trust_of(working.confidence, task.settings.confidence_weights)
    shape = recover_shape(working.diffuse, task, task.monitor.part(0.08, 0.92), trust)
    lobe = fit_specular(split, shape, task, task.monitor.part(0.92, 0.96))
    return Answer(split, shape.height, shape.light, shape.status | lobe.status, lobe.brdf)
