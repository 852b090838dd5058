"""Which assumptions of the models a photo violates: an opaque glossy object, one small lamp and a
smooth light of about one colour.

Problem: for a mirror, for glass, or under several lamps a model also finds albedo, shape and light
that reproduce the photo, but wrong ones.

Equation: `networks.scene_classifier` gives the probability of each class of scene,
`networks.light_network` that of several lamps; where both predict it, the mean of their log odds
counts. Above a threshold the confidence is multiplied by the remaining probability of an opaque
object under one lamp, and the diagnostics get a warning. Warnings also cover clipping of much of
the object, and a mask too ragged for a mesh.

Citation: see `networks.scene_classifier` and `networks.light_network`.

Limits: measured in docs/methods/assumption_checks.md. Strongly coloured light is covered by
`illuminant.gamut`.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy import ndimage

from ..networks.scene_classifier import GLASS, LAMPS, MIRROR, ORDINARY, classify_scene
from ..photo import Photo
from ..scene.diagnostics import AssumptionWarning, WarningKind
from ..scene.light_estimate import LightEstimate
from .layers import scale_confidence
from .task import SceneEstimate

_MUCH_CLIPPED = 0.1  # of the object; single highlights are smaller
_RAGGED = 0.5  # of the mask outside blocks of 2 x 2 pixels, which no mesh covers
LIKELY_CLEAR = 0.6  # probability of a mirror or glass
LIKELY_SEVERAL = 0.4  # probability of several lamps: lower, for a second lamp is often weak
_LEAST = 0.1  # of the confidence remains
_SURE = 1e-4  # no network is surer


def check_scene(
    classes: Mapping[str, float], light_estimate: LightEstimate
) -> tuple[AssumptionWarning, ...]:
    """Check the predicted class of scene and number of lights.

    Parameters
    ----------
    classes : mapping of str to float
        Probabilities by `networks.scene_classifier.classify_scene`.
    light_estimate : LightEstimate
        The predicted light.

    Returns
    -------
    tuple of AssumptionWarning
        Empty where the assumptions hold.
    """
    clear, several = classes[MIRROR] + classes[GLASS], several_lights(classes, light_estimate)
    found = []
    if clear > LIKELY_CLEAR:
        found.append(AssumptionWarning(WarningKind.MIRROR_OR_GLASS, round(clear, 4)))
    if several > LIKELY_SEVERAL:
        found.append(AssumptionWarning(WarningKind.SEVERAL_LIGHTS, round(several, 4)))
    return tuple(found)


def several_lights(classes: Mapping[str, float], light_estimate: LightEstimate) -> float:
    """Compute the probability of several lamps: the mean of two networks' log odds.

    One network has been trained on photos, mirrors and rooms, the other on many more lamps.

    Parameters
    ----------
    classes : mapping of str to float
        Probabilities by `networks.scene_classifier.classify_scene`.
    light_estimate : LightEstimate
        The predicted light.

    Returns
    -------
    float
        In [0, 1].
    """
    odds = [
        np.log((share + _SURE) / (1 - share + _SURE))
        for share in (classes[LAMPS], light_estimate.several)
    ]
    return float(1 / (1 + np.exp(-np.mean(odds))))


def check_photo(photo: Photo) -> tuple[AssumptionWarning, ...]:
    """Check the photo's exposure and its mask.

    Parameters
    ----------
    photo : Photo
        The photo.

    Returns
    -------
    tuple of AssumptionWarning
        Empty where both are sound.
    """
    clipped, ragged = float(photo.clipped[photo.mask].mean()), 1 - share_in_blocks(photo.mask)
    found = []
    if clipped > _MUCH_CLIPPED:
        found.append(AssumptionWarning(WarningKind.CLIPPED, round(clipped, 4)))
    if ragged > _RAGGED:
        found.append(AssumptionWarning(WarningKind.RAGGED_MASK, round(ragged, 4)))
    return tuple(found)


def share_in_blocks(mask: np.ndarray) -> float:
    """Compute the share of a mask that lies in blocks of 2 x 2 pixels inside it.

    Parameters
    ----------
    mask : (H, W) ndarray of bool
        The object.

    Returns
    -------
    float
        In [0, 1].
    """
    return float(ndimage.binary_opening(mask, np.ones((2, 2))).sum() / max(int(mask.sum()), 1))


def with_warnings(
    maps: Photo, estimate: SceneEstimate, light_estimate: LightEstimate
) -> SceneEstimate:
    """Add the assumption checks to an estimate, and lower its confidence where they fail.

    Parameters
    ----------
    maps : Photo
        The photo of the estimate's maps.
    estimate : SceneEstimate
        What a model recovered.
    light_estimate : LightEstimate
        The predicted light.

    Returns
    -------
    SceneEstimate
        With probabilities and warnings in its diagnostics.
    """
    classes = classify_scene(maps.image, maps.mask)
    warnings = check_scene(classes, light_estimate)
    split = estimate.split
    if warnings:
        remaining = _probability_of_model(warnings, classes, light_estimate)
        split = scale_confidence(split, max(remaining, _LEAST))
    diagnostics = replace(
        estimate.diagnostics,
        scene_classes={kind: round(share, 4) for kind, share in classes.items()},
        light_counts={
            "none": round(light_estimate.none, 4),
            "one": round(light_estimate.one, 4),
            "several": round(light_estimate.several, 4),
        },
        several_lights=round(several_lights(classes, light_estimate), 4),
        warnings=warnings + check_photo(maps),
    )
    return replace(estimate, split=split, diagnostics=diagnostics)


def _probability_of_model(
    warnings: tuple[AssumptionWarning, ...],
    classes: Mapping[str, float],
    light_estimate: LightEstimate,
) -> float:
    """The probability that the violated assumptions hold nevertheless."""
    kinds = {warning.kind for warning in warnings}
    opaque = classes[ORDINARY] + classes[LAMPS] if WarningKind.MIRROR_OR_GLASS in kinds else 1.0
    several = several_lights(classes, light_estimate)
    return opaque * (1 - several if WarningKind.SEVERAL_LIGHTS in kinds else 1.0)
