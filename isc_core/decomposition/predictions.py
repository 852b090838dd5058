"""Predictions of the scene network, as soft terms of the models.

The network is run once, on the working photo with its highlights, since it was trained on such
photos. Quantities that are given are not replaced: normals, or a shape behind an observed depth.

Equation: see `networks.scene_network`; how normals, shading and light enter SIRFS is in
`sirfs.normal_prior`, `sirfs.shading_term` and `sirfs.priors.light_posterior`.

Limits: those of the network; measured in docs/methods/scene_network.md.
"""

from dataclasses import replace

import numpy as np

from ..networks.scene_network import predict_scene
from .task import DecompositionTask


def with_predictions(task: DecompositionTask) -> DecompositionTask:
    """Run the network, and add normals, shading and light as far as the settings use them.

    Parameters
    ----------
    task : DecompositionTask
        Predictions that it already has are kept.

    Returns
    -------
    DecompositionTask
        The same where nothing uses the network.
    """
    settings, options = task.settings, task.options
    shape = (
        settings.uses_predicted_normals
        and task.normal_estimate is None
        and task.known.depth is None
    )
    light = settings.uses_predicted_light and task.light_coefficients is None
    others = options.check_assumptions or options.fit_lobe or settings.model == "joint"
    seen = task.prediction
    if not (shape or light) and (seen is not None or not others):
        return task
    if seen is None:
        photo = task.working
        with task.clock.stage("predict scene"):
            image = photo.image.astype(np.float32, copy=False)
            seen = predict_scene(image, photo.mask, options.scene_network, task.kept)
    return replace(
        task,
        prediction=seen,
        normal_estimate=seen.normals if shape else task.normal_estimate,
        light_coefficients=seen.light if light else task.light_coefficients,
        shading_estimate=task.shading_estimate or (seen.shading if light else None),
    )
