"""Which assumptions of the models a photo violates: an opaque glossy object, one small lamp and a
smooth light of about one colour.

Problem: for a mirror, for glass, or under several lamps a model also finds albedo, shape and light
that reproduce the photo, but wrong ones.

Equation: `networks.scene_network` gives the probabilities of a mirror, of glass and of several
lamps. Above a threshold the diagnostics get a warning. With that about several lamps, the
confidence is multiplied by the remaining probability of one lamp. Warnings also cover clipping of
much of the object, and a mask too ragged for a mesh.

Citation: see `networks.scene_network`.

Limits: measured in docs/methods/assumption_checks.md. On photos by people, the warning about
mirrors and glass is wrong more often than right, so it does not change the confidence. Strongly
coloured light is covered by `illuminant.gamut`.
"""

from dataclasses import replace

import numpy as np

from ..filters.morphology import opened_by_blocks
from ..networks.scene_network import Kind, ScenePrediction
from ..photo import Photo
from ..scene.diagnostics import AssumptionWarning, Diagnostics, WarningKind
from .layers import scale_confidence
from .task import SceneEstimate

_MUCH_CLIPPED = 0.1  # of the object; single highlights are smaller
_MUCH_DOUBTFUL = 0.005  # of the light: a highlight of a hundredth of the object
_RAGGED = 0.5  # of the mask outside blocks of 2 x 2 pixels, which no mesh covers
MIRROR_OR_GLASS_THRESHOLD = 0.5  # probability of a mirror or glass
SEVERAL_LAMPS_THRESHOLD = 0.6  # probability of several lamps
_LEAST = 0.1  # of the confidence remains
_COLOURED = 0.5  # of it remains in light of too strong a colour


def check_scene(prediction: ScenePrediction) -> tuple[AssumptionWarning, ...]:
    """Check the material of the object and the number of lamps.

    Parameters
    ----------
    prediction : ScenePrediction
        Of the photo.

    Returns
    -------
    tuple of AssumptionWarning
        Empty where the assumptions hold.
    """
    clear, several, found = 1 - float(prediction.kinds[0]), prediction.lamps.several, []
    if clear > MIRROR_OR_GLASS_THRESHOLD:
        found.append(AssumptionWarning(WarningKind.MIRROR_OR_GLASS, round(clear, 4)))
    if several > SEVERAL_LAMPS_THRESHOLD:
        found.append(AssumptionWarning(WarningKind.SEVERAL_LIGHTS, round(several, 4)))
    return tuple(found)


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


def check_highlights(diagnostics: Diagnostics) -> tuple[AssumptionWarning, ...]:
    """Check whether much light that may be highlights remains in the diffuse image.

    Parameters
    ----------
    diagnostics : Diagnostics
        Of the model.

    Returns
    -------
    tuple of AssumptionWarning
    """
    share = diagnostics.doubtful_highlights or 0.0
    if share < _MUCH_DOUBTFUL:
        return ()
    return (AssumptionWarning(WarningKind.DOUBTFUL_HIGHLIGHTS, share),)


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
    return float(opened_by_blocks(mask).sum() / max(int(mask.sum()), 1))


def confidence_factor(diagnostics: Diagnostics) -> float:
    """Compute the factor by which the confidence of a photo that violates assumptions is lowered.

    Parameters
    ----------
    diagnostics : Diagnostics

    Returns
    -------
    float
        The probability of one lamp, at least .1, where there is a warning about several; half of
        that where light or object have too strong a colour. 1 where these assumptions hold.
    """
    several = [
        one.value or 0.0 for one in diagnostics.warnings if one.kind is WarningKind.SEVERAL_LIGHTS
    ]
    share = max(1 - max(several, default=0.0), _LEAST)
    strong = diagnostics.light_colour is not None and diagnostics.light_colour.outcome.too_strong
    return share * (_COLOURED if strong else 1.0)


def with_warnings(
    maps: Photo, estimate: SceneEstimate, prediction: ScenePrediction
) -> SceneEstimate:
    """Add the assumption checks to an estimate, and lower its confidence where they fail.

    Parameters
    ----------
    maps : Photo
        The photo of the estimate's maps.
    estimate : SceneEstimate
        What a model recovered.
    prediction : ScenePrediction
        Of the photo.

    Returns
    -------
    SceneEstimate
        With probabilities and warnings in its diagnostics.
    """
    warnings, split, lamps = check_scene(prediction), estimate.split, prediction.lamps
    if warnings:
        split = scale_confidence(split, confidence_factor(Diagnostics(warnings=warnings)))
    diagnostics = replace(
        estimate.diagnostics,
        scene_classes={
            str(kind): round(float(share), 4)
            for kind, share in zip(Kind, prediction.kinds, strict=True)
        },
        light_counts={
            "none": round(lamps.none, 4),
            "one": round(lamps.one, 4),
            "several": round(lamps.several, 4),
        },
        several_lights=round(lamps.several, 4),
        warnings=warnings + check_photo(maps) + check_highlights(estimate.diagnostics),
    )
    return replace(estimate, split=split, diagnostics=diagnostics)
