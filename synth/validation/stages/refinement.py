"""The stage "refine": a result before and after the refinement of its gloss.

The photo is decomposed as by `isc decompose`, with all highlights that are found by colour and
shape, and its gloss is refined. Errors are those of the refined result over those of the start, so
that a mean over scenes is a paired comparison; the ratio is 1 if the start is kept. They are
undefined where no highlight was separated.

Limits: those of `isc_core.refinement`. The stage is run only on request.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.decomposition.pipeline import decompose
from isc_core.decomposition.settings import Settings
from isc_core.evaluation.metrics import scaled_mse
from isc_core.photo import Photo, PhotoSource
from isc_core.progress import Monitor
from isc_core.refinement import GlossRefinement, refine_gloss
from isc_core.scene.decomposition import Decomposition

from ...capture.truth import GroundTruth
from .pictures import exposure, lit
from .types import BLACK, Metric, Stage, StageInputs, StageOptions, StagePicture

_BRIGHT = 0.2  # of the brightest separated light: a highlight
_LEAST = 1e-12


@dataclass(frozen=True)
class Refined:
    """A result, and the outcome of its refinement."""

    start: Decomposition
    done: GlossRefinement


@dataclass(frozen=True)
class RefinementScores:
    """Errors of the refined result over those of the start. None: nothing to fit.

    Attributes
    ----------
    photo : float or None
        Mean square error of the diffuse layer with the lobe's image, against the photo.
    gloss : float or None
        Of the lobe's image, against the true specular layer; undefined on diffuse objects.
    normal : float or None
        Mean angle between normals where highlights were separated.
    reflectance : float or None
        Mean square error after one scale.
    kept : float or None
        1 or 0: whether the new gloss was kept.
    """

    photo: float | None = None
    gloss: float | None = None
    normal: float | None = None
    reflectance: float | None = None
    kept: float | None = None


def run_refinement(inputs: StageInputs, options: StageOptions, monitor: Monitor) -> Refined:
    """Decompose the photo and refine its gloss.

    Parameters
    ----------
    inputs : StageInputs
        The photo.
    options : StageOptions
        Separator, light prior and threads.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    Refined
        Both results.

    Raises
    ------
    InputError
        If the photo cannot be decomposed.
    Cancelled
        If the user cancels.
    """
    height, width = inputs.mask.shape
    # Noise can push light below zero, which no photo contains.
    photo = Photo(
        np.maximum(inputs.image, 0),
        inputs.mask,
        2 * BLACK,
        inputs.clipped,
        PhotoSource("", (width, height), 16, "linear", "file"),
    )
    settings = Settings(
        separator=options.separator,
        illumination=options.illumination,
        threads=options.threads,
        highlight_odds=0.0,
    )
    start = decompose(photo, settings, monitor=monitor.part(0.0, 0.6))
    return Refined(start, refine_gloss(start, monitor=monitor.part(0.6, 1.0)))


def score_refinement(truth: GroundTruth, answer: Refined) -> RefinementScores:
    """Compare the refined result with the start.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answer : Refined
        Both results.

    Returns
    -------
    RefinementScores
        The scores.
    """
    if not answer.done.lamps:
        return RefinementScores()
    photo, gloss, normal, reflectance = (
        None if before is None or after is None else max(after, _LEAST) / max(before, _LEAST)
        for before, after in zip(
            _errors(truth, answer.start, answer.start),
            _errors(truth, answer.start, answer.done.result),
            strict=True,
        )
    )
    return RefinementScores(photo, gloss, normal, reflectance, float(answer.done.kept))


def _errors(
    truth: GroundTruth, start: Decomposition, d: Decomposition
) -> tuple[float | None, float | None, float | None, float | None]:
    mask, shown = start.mask, start.specular.mean(axis=2)
    lobe = d.lobe
    photo = np.square(d.image - d.diffuse - lobe)[mask].mean(dtype=float)
    glossy = truth.specular[mask].any()
    gloss = np.square(truth.specular - lobe)[mask].mean(dtype=float) if glossy else None
    bright = mask & (shown > _BRIGHT * shown.max())
    turn = np.clip((d.normal[bright] * truth.normal[bright]).sum(axis=1), -1, 1)
    normal = float(np.degrees(np.arccos(turn)).mean())
    error = scaled_mse(truth.reflectance[mask], d.reflectance[mask])
    return float(photo), None if gloss is None else float(gloss), normal, error


def show_refinement(truth: GroundTruth, answer: Refined) -> tuple[StagePicture, ...]:
    """Return pictures of the photo, and of the diffuse layers with the lobes, with one exposure.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answer : Refined
        Both results.

    Returns
    -------
    tuple of StagePicture
        Three.
    """
    gain = exposure(truth.image, truth.mask)
    pairs = [("photo", truth.image)]
    for caption, d in (("start, rendered", answer.start), ("refined", answer.done.result)):
        pairs.append((caption, d.diffuse + d.lobe))
    return tuple(StagePicture(caption, lit(gain * values, truth.mask)) for caption, values in pairs)


def refinement_maps(answer: Refined) -> dict[str, np.ndarray]:
    """Return the channels of the specular layer and of both lobes.

    Parameters
    ----------
    answer : Refined
        Both results.

    Returns
    -------
    dict of str to (H, W) ndarray
        By channel name: "specular.R", "start.R", "refined.R".
    """
    layers = {"specular": answer.start.specular}
    for name, d in (("start", answer.start), ("refined", answer.done.result)):
        layers[name] = d.lobe
    return {
        f"{name}.{letter}": values[..., k]
        for name, values in layers.items()
        for k, letter in enumerate("RGB")
    }


REFINEMENT = Stage(
    name="refine",
    title="Refined gloss, errors over those of the start",
    needs=(),
    metrics=(
        Metric("photo", "diffuse layer with lobe against the photo"),
        Metric("gloss", "lobe against the true specular layer"),
        Metric("normal", "normals where highlights are"),
        Metric("reflectance", "reflectance"),
        Metric("kept", "kept", geometric=False, larger_is_better=True),
    ),
    run=run_refinement,
    score=score_refinement,
    show=show_refinement,
    maps=refinement_maps,
)
