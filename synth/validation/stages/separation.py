"""The stage "separation": the estimated diffuse and specular layers against the rendered ones,
inside the mask.

The diffuse error is also given relative to that of the unmodified photo, which is hard to beat
where highlights are few. Sparsification and rank correlation measure whether the confidence map
predicts the errors (see `isc_core.evaluation.image_metrics`).
"""

import math
from dataclasses import dataclass

import numpy as np

from isc_core.evaluation.image_metrics import rank_correlation, sparsification
from isc_core.evaluation.metrics import lmse, mse, psnr
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from isc_core.separation import separate

from ...capture.truth import GroundTruth
from .pictures import exposure, lit, signed_error
from .types import Metric, Stage, StageInputs, StageOptions, StagePicture

_EQUAL = 120.0  # dB, for equal images: near the precision of float32
_LEAST = 1e-12  # mean square of the specular layer below which there is no highlight to remove
_DROPPED = 0.2


@dataclass(frozen=True)
class SeparationScores:
    """Errors inside the mask, of linear values. None: undefined.

    All but `taken` are defined on scenes with specular light only: a method that does not modify a
    diffuse scene has an error of zero, which would dominate every geometric mean.

    Attributes
    ----------
    mse_diffuse, mse_specular : float or None
        Mean square errors.
    lmse_diffuse, lmse_specular : float or None
        Local mean square errors after Grosse et al.
    psnr_diffuse, psnr_specular : float or None
        dB relative to a white of 1, at most 120.
    mse_ratio : float or None
        Diffuse error relative to that of the unmodified photo.
    removed : float or None
        Share of the squared error in the least confident fifth of the pixels.
    rank : float or None
        Rank correlation of confidence and squared error; -1 is best.
    taken : float or None
        On scenes without specular light: RMS of the light removed from the photo, relative to the
        photo's RMS.
    """

    mse_diffuse: float | None = None
    mse_specular: float | None = None
    lmse_diffuse: float | None = None
    lmse_specular: float | None = None
    psnr_diffuse: float | None = None
    psnr_specular: float | None = None
    mse_ratio: float | None = None
    removed: float | None = None
    rank: float | None = None
    taken: float | None = None


def run_separation(inputs: StageInputs, options: StageOptions, monitor: Monitor) -> Separation:
    """Separate the photo with `options.separator`.

    Parameters
    ----------
    inputs : StageInputs
        Photo, mask and clipped pixels.
    options : StageOptions
        Which separator.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    Separation
        The layers.

    Raises
    ------
    InputError
        If the separator cannot process the photo.
    Cancelled
        If the user cancels.
    """
    return separate(options.separator, inputs.image, inputs.mask, inputs.clipped, monitor=monitor)


def score_separation(truth: GroundTruth, answer: Separation) -> SeparationScores:
    """Compute the errors of both layers.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answer : Separation
        The estimated layers.

    Returns
    -------
    SeparationScores
        The errors.

    Raises
    ------
    ValueError
        For an empty mask.
    """
    mask = truth.mask
    black = np.zeros_like(truth.image)
    # Not the photo less the diffuse layer: the sensor's noise is no highlight.
    if mse(black, truth.specular, mask) <= _LEAST:
        changed, light = (mse(truth.image, other, mask) for other in (answer.diffuse, black))
        return SeparationScores(taken=math.sqrt(changed / max(light, _LEAST)))
    nothing, wrong = mse(truth.diffuse, truth.image, mask), mse(truth.diffuse, answer.diffuse, mask)
    squared = np.square(answer.diffuse[mask].astype(float) - truth.diffuse[mask]).mean(axis=1)
    confidence = answer.confidence[mask]
    sortable = wrong > _LEAST
    return SeparationScores(
        mse_diffuse=wrong,
        mse_specular=mse(truth.specular, answer.specular, mask),
        lmse_diffuse=_local(truth.diffuse, answer.diffuse, mask),
        lmse_specular=_local(truth.specular, answer.specular, mask),
        psnr_diffuse=min(_EQUAL, psnr(truth.diffuse, answer.diffuse, mask)),
        psnr_specular=min(_EQUAL, psnr(truth.specular, answer.specular, mask)),
        mse_ratio=wrong / max(nothing, _LEAST),
        removed=sparsification(squared, confidence).removed(_DROPPED) if sortable else None,
        rank=rank_correlation(confidence, squared) if sortable and np.ptp(confidence) > 0 else None,
    )


def show_separation(truth: GroundTruth, answer: Separation) -> tuple[StagePicture, ...]:
    """Return pictures of the layers, with one exposure.

    Parameters
    ----------
    truth : GroundTruth
        The scene.
    answer : Separation
        The estimated layers.

    Returns
    -------
    tuple of StagePicture
        The photo, true and estimated layers, and the error of the diffuse layer.
    """
    gain = exposure(truth.image, truth.mask)
    pairs = [
        ("photo", truth.image),
        ("diffuse, true", truth.diffuse),
        ("diffuse, estimated", answer.diffuse),
    ]
    pairs += [("specular, true", truth.specular), ("specular, estimated", answer.specular)]
    error = StagePicture(
        "error: orange too bright, blue too dark",
        signed_error(gain * (answer.diffuse - truth.diffuse), truth.mask),
    )
    return (
        *(StagePicture(caption, lit(gain * values, truth.mask)) for caption, values in pairs),
        error,
    )


def separation_maps(answer: Separation) -> dict[str, np.ndarray]:
    """Return the channels of the layers, named as `isc separate` names them.

    Parameters
    ----------
    answer : Separation
        The stage's result.

    Returns
    -------
    dict of str to (H, W) ndarray
        By channel name: "diffuse.R".
    """
    layers = {"diffuse": answer.diffuse, "specular": answer.specular, "residual": answer.residual}
    planes = {
        f"{name}.{letter}": values[..., k]
        for name, values in layers.items()
        for k, letter in enumerate("RGB")
    }
    return planes | {"confidence.Y": answer.confidence}


def _local(truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray) -> float | None:
    """Grosse's local error, None if a channel of the truth is zero everywhere."""
    if not (truth[mask] > 0).any(axis=0).all():
        return None
    error = lmse(truth, estimate, mask)
    return error if math.isfinite(error) else None


SEPARATION = Stage(
    name="separation",
    title="Separation of diffuse and specular light",
    needs=(),
    metrics=(
        Metric("mse_ratio", "diffuse MSE, relative to the photo"),
        Metric("mse_diffuse", "diffuse MSE"),
        Metric("mse_specular", "specular MSE"),
        Metric("lmse_diffuse", "diffuse LMSE"),
        Metric("lmse_specular", "specular LMSE"),
        Metric(
            "psnr_diffuse", "diffuse PSNR", "dB", geometric=False, larger_is_better=True, margin=0.5
        ),
        Metric(
            "psnr_specular",
            "specular PSNR",
            "dB",
            geometric=False,
            larger_is_better=True,
            margin=0.5,
        ),
        Metric(
            "removed",
            "error share of the least confident fifth",
            geometric=False,
            larger_is_better=True,
            margin=0.05,
        ),
        Metric("rank", "rank correlation of confidence and error", geometric=False, margin=0.05),
        Metric("taken", "removed from diffuse scenes, RMS", geometric=False, margin=0.005),
    ),
    run=run_separation,
    score=score_separation,
    show=show_separation,
    maps=separation_maps,
)
