"""The stage "models": all models on a glossy photo, compared with plain SIRFS on the same photo and
SIRFS on the true diffuse layer.

Each model runs as in `isc decompose` (`isc_core.decomposition.solve`), and is scored like the stage
"sirfs". Errors are relative to plain SIRFS on the same scene, so that a mean over scenes is a
paired comparison; the true diffuse layer shows the gain of a perfect separation.

MBP has the shape and light of plain SIRFS by definition: they are solved once.

Limits: SIRFS solves with the object 256 pixels long, as for a photo, not at the image's own size as
in the stage "sirfs" and the chain: the figures of the two are not comparable. Black channels, in
the shadows of directional lights, are raised to half a code, for all variants alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Generic, TypeVar

import numpy as np

from isc_core.decomposition.layers import normals_and_shading, separated
from isc_core.decomposition.models import DecompositionTask, SceneEstimate, Settings, solve
from isc_core.decomposition.predictions import with_predictions
from isc_core.decomposition.settings import SEPARATING_MODELS
from isc_core.evaluation.evaluate import Estimate
from isc_core.evaluation.metrics import Scores
from isc_core.photo import Photo, PhotoSource
from isc_core.progress import Monitor
from isc_core.scene.known_inputs import SceneConstraints
from isc_core.shading.spherical_harmonics import light_from_reference

from ...capture.truth import GroundTruth
from .pictures import directions, exposure, lit
from .sirfs import SIRFS, score_sirfs, sirfs_maps, with_normals
from .types import BLACK, AnyStage, Metric, Stage, StageInputs, StageOptions, StagePicture

NAME = "models"
TITLE = "Models beside plain SIRFS"
PLAIN, TRUE_DIFFUSE = "plain", "true_diffuse"
TITLES = {PLAIN: "plain SIRFS", TRUE_DIFFUSE: "SIRFS on the true diffuse layer"} | {
    name: name for name in SEPARATING_MODELS
}
ERRORS = SIRFS.metrics
_STARTS = {"mbp": PLAIN}  # which variant's shape and light a model reuses
_SMALLEST = 1e-30

Item = TypeVar("Item")


@dataclass(frozen=True)
class Variants(Generic[Item]):
    """One item for each way to decompose a photo. None: not requested.

    Attributes
    ----------
    plain : Item
        SIRFS on the photo.
    true_diffuse : Item
        SIRFS on the true diffuse layer.
    mdr, mbp, joint : Item or None
        The models.
    """

    plain: Item
    true_diffuse: Item
    mdr: Item | None = None
    mbp: Item | None = None
    joint: Item | None = None

    def items(self) -> tuple[tuple[str, Item], ...]:
        """Return names and items of the variants that were requested."""
        found = ((field.name, getattr(self, field.name)) for field in fields(self))
        return tuple((name, item) for name, item in found if item is not None)


def run_models(inputs: StageInputs, options: StageOptions, monitor: Monitor) -> Variants[Estimate]:
    """Decompose the photo in every way.

    Parameters
    ----------
    inputs : StageInputs
        The photo with its true diffuse layer; `split` is used if known, but for the joint model.
    options : StageOptions
        Models, separator, light prior and threads.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    Variants of Estimate
        The maps.

    Raises
    ------
    InputError
        If a model cannot process the photo.
    Cancelled
        If the user cancels.
    """
    if inputs.diffuse is None:
        raise ValueError(
            "the models are compared with SIRFS on the true diffuse layer, which has to be given"
        )
    photo = _photo(inputs)
    split = separated(photo, options.separator, monitor) if inputs.split is None else inputs.split
    # Predictions from the photo are also used for its diffuse layer. Without fine relief, so that
    # models that share a shape share its normals.
    usual = Settings(
        "sirfs", options.separator, options.illumination, detail=0, threads=options.threads
    )
    seen = with_predictions(DecompositionTask(photo, photo, usual, monitor=monitor))

    def solved(model: str, image: Photo, start: SceneEstimate | None = None) -> SceneEstimate:
        known = SceneConstraints() if start is None else SceneConstraints(start.height, start.light)
        settings = replace(usual, model=model)
        layers = None if settings.separates_by_colour else split
        return solve(
            replace(seen, working=image, maps=image, settings=settings, known=known, split=layers)
        )

    answers = {PLAIN: solved("sirfs", photo)}
    for name in (name for name in SEPARATING_MODELS if name in options.models):
        answers[name] = solved(name, photo, answers.get(_STARTS.get(name, "")))
    answers[TRUE_DIFFUSE] = solved(
        "sirfs", replace(photo, image=inputs.diffuse, clipped=np.zeros_like(inputs.clipped))
    )
    return Variants(**{name: _estimate(inputs, answer) for name, answer in answers.items()})


def score_models(truth: GroundTruth, answers: Variants[Estimate]) -> Variants[Scores]:
    """Compute the errors of plain SIRFS, and those of all others relative to them.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answers : Variants of Estimate
        The estimated maps.

    Returns
    -------
    Variants of Scores
        The errors.

    Raises
    ------
    InputError
        If the true diffuse image is black.
    """
    errors = {name: score_sirfs(truth, answer) for name, answer in answers.items()}
    plain = errors[PLAIN]
    return Variants(
        **{name: own if name == PLAIN else _relative(own, plain) for name, own in errors.items()}
    )


def show_models(truth: GroundTruth, answers: Variants[Estimate]) -> tuple[StagePicture, ...]:
    """Return pictures of all variants, scaled to the truth's brightness.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answers : Variants of Estimate
        The estimated maps.

    Returns
    -------
    tuple of StagePicture
        The photo, then diffuse layers, reflectance and normals.
    """
    mask, items = truth.mask, answers.items()
    gain = exposure(truth.image, mask)
    shown = [
        StagePicture("photo", lit(gain * truth.image, mask)),
        StagePicture("diffuse, true", lit(gain * truth.diffuse, mask)),
    ]
    diffuse = [
        (name, own.reflectance * own.shading)
        for name, own in items
        if name not in (PLAIN, TRUE_DIFFUSE)
    ]
    shown += [
        StagePicture(f"diffuse, {name}", lit(gain * values, mask)) for name, values in diffuse
    ]
    gain = exposure(truth.reflectance, mask)
    shown.append(StagePicture("reflectance, true", lit(gain * truth.reflectance, mask)))
    for name, own in items:
        scale = (truth.reflectance[mask] * own.reflectance[mask]).sum() / max(
            np.square(own.reflectance[mask]).sum(), _SMALLEST
        )
        shown.append(
            StagePicture(f"reflectance, {TITLES[name]}", lit(gain * scale * own.reflectance, mask))
        )
    shown.append(StagePicture("normals, true", directions(truth.normal, mask)))
    return (
        *shown,
        *(
            StagePicture(f"normals, {TITLES[name]}", directions(own.normal, mask))
            for name, own in items
        ),
    )


def models_maps(answers: Variants[Estimate]) -> Mapping[str, np.ndarray]:
    """Return the channels of all maps.

    Parameters
    ----------
    answers : Variants of Estimate
        The results of all variants.

    Returns
    -------
    mapping of str to (H, W) ndarray
        By channel name: "joint.reflectance.R".
    """
    return {
        f"{name}.{channel}": values
        for name, own in answers.items()
        for channel, values in sirfs_maps(own).items()
    }


def models_stage(models: tuple[str, ...]) -> AnyStage:
    """Return the stage for some models; the first one ranks the scenes.

    Parameters
    ----------
    models : tuple of str
        As in `StageOptions.models`.

    Returns
    -------
    Stage
        The stage.
    """
    named = [(name, metric) for name in (*models, TRUE_DIFFUSE, PLAIN) for metric in ERRORS]
    return Stage(
        name=NAME,
        title=TITLE,
        needs=("diffuse",),
        metrics=tuple(_metric(name, error) for name, error in named),
        run=run_models,
        score=score_models,
        show=show_models,
        maps=models_maps,
    )


def metric_name(variant: str, error: str) -> str:
    """Return the metric of one error of one variant.

    Parameters
    ----------
    variant, error : str
        Names of the variant and of the error.

    Returns
    -------
    str
        For example "joint.average".
    """
    return f"{variant}.{error}"


def _metric(variant: str, error: Metric) -> Metric:
    """An error of plain SIRFS is absolute, of the others relative to it."""
    unit = error.unit if variant == PLAIN else ""
    return Metric(metric_name(variant, error.name), f"{TITLES[variant]}: {error.title}", unit)


def _photo(inputs: StageInputs) -> Photo:
    """The scene's image as a photo with 16-bit codes.

    Noise can push light below zero, which no photo contains.
    """
    height, width = inputs.mask.shape
    source = PhotoSource("", (width, height), 16, "linear", "file")
    return Photo(np.maximum(inputs.image, 0), inputs.mask, 2 * BLACK, inputs.clipped, source)


def _estimate(inputs: StageInputs, answer: SceneEstimate) -> Estimate:
    normal, _ = normals_and_shading(answer.height, answer.light, inputs.mask)
    return with_normals(
        replace(inputs, diffuse=answer.split.diffuse),
        answer.height,
        normal,
        light_from_reference(answer.light),
    )


def _relative(errors: Scores, plain: Scores) -> Scores:
    """Each error relative to that of plain SIRFS; 1 if both are zero."""
    pairs = ((getattr(errors, field.name), getattr(plain, field.name)) for field in fields(Scores))
    return Scores(*(max(own, _SMALLEST) / max(other, _SMALLEST) for own, other in pairs))
