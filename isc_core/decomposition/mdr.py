"""Modified Dichromatic Reflectance: the specular light is separated first, then SIRFS solves the
diffuse image.

Equation: image = reflectance * shading + specular.

Citation: H. Akbar, "3D Intrinsic Scene Characteristics Extraction Framework for a Single Image"
(2016; no DOI); the dichromatic model: S. A. Shafer 1985, doi:10.1002/col.5080100409.

With `Settings.confidence_weights` pixels are weighted in SIRFS' reflectance terms by the
separation's confidence (`sirfs.reflectance`).

Limits: SIRFS takes the separation's errors, in either direction, at face value.
"""

from dataclasses import replace

from .layers import separated_at_both_scales
from .lobe import fit_specular
from .shape import confidence_weight, recover_shape
from .task import DecompositionTask, SceneEstimate


def mdr(task: DecompositionTask) -> SceneEstimate:
    """Separate the photo, recover shape and light of the diffuse image, and fit the lobe.

    Parameters
    ----------
    task : DecompositionTask
        The photo and the settings.

    Returns
    -------
    SceneEstimate
        With the separator's layers.

    Raises
    ------
    InputError
        If the photo cannot be separated or the known quantities do not fit.
    Cancelled
        If the monitor cancels.
    """
    split, working = separated_at_both_scales(task)
    weight = confidence_weight(working.confidence, task.settings.confidence_weights)
    shape = recover_shape(working.diffuse, task, task.monitor.part(0.08, 0.92), weight)
    lobe = fit_specular(split, shape, task, task.monitor.part(0.92, 0.96))
    diagnostics = replace(shape.diagnostics, lobe=lobe.diagnostics)
    return SceneEstimate(split, shape.height, shape.light, diagnostics, lobe.brdf)
