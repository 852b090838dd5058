"""Ways to use predictions in SIRFS, as the benchmarks name and compare them.

A way is "normals:shading:temperature": the weights of predicted normals and log shading and the
temperature of the predicted light (`PredictionWeights`); "-" leaves a prediction out.
"""

from dataclasses import dataclass, replace

from isc_core.decomposition.task import DecompositionTask
from isc_core.scene.light_coefficients_estimate import LightCoefficientsEstimate
from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.scene.shading_estimate import ShadingEstimate
from isc_core.sirfs.settings import PredictionWeights, prediction_weights


@dataclass(frozen=True)
class Predictions:
    """What was predicted of a photo.

    Attributes
    ----------
    normals : NormalEstimate
    shading : ShadingEstimate
    light : LightCoefficientsEstimate
    """

    normals: NormalEstimate
    shading: ShadingEstimate
    light: LightCoefficientsEstimate


def with_way(
    task: DecompositionTask,
    predictions: Predictions,
    way: str,
    usual: PredictionWeights | None = None,
) -> DecompositionTask:
    """Add predictions to a task.

    Parameters
    ----------
    task : DecompositionTask
        Without predictions.
    predictions : Predictions
    way : str
    usual : PredictionWeights, optional
        All that the way leaves open; by default that of the task's illumination.

    Returns
    -------
    DecompositionTask
    """
    normals, shading, light = (None if part == "-" else float(part) for part in way.split(":"))
    usual = usual or prediction_weights(task.settings.illumination)
    weights = replace(
        usual,
        normals=usual.normals if normals is None else normals,
        shading=usual.shading if shading is None else shading,
        light_temperature=usual.light_temperature if light is None else light,
    )
    return replace(
        task,
        normal_estimate=None if normals is None else predictions.normals,
        shading_estimate=None if shading is None else predictions.shading,
        light_coefficients=None if light is None else predictions.light,
        options=replace(task.options, prediction_weights=weights),
    )
