"""The stage "separation": the photo's diffuse and specular layers against those that were rendered,
inside the mask.

An error is also given as a ratio to that of doing nothing (diffuse = photo): where there are few
highlights, doing nothing is hard to beat. Whether the confidence knows where the errors are is told
by sparsification and rank (see `isc_core.evaluation.image_metrics`).
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

_EQUAL = 120.0  # dB: what equal images count as, near the precision of float32
_LEAST = 1e-12  # mean square error of doing nothing below which there is no highlight to remove
_DROPPED = 0.2


@dataclass(frozen=True)
class SeparationScores:
    """Inside the mask, of linear values. None: not defined. All but `taken` are of scenes with
    specular light, since a method that leaves a matt scene alone has errors of zero, which would
    rule every geometric mean.

    `mse_*`: mean square errors; `lmse_*`: Grosse's local error; `psnr_*`: dB for a white of 1, 120
    at most. `mse_ratio`: diffuse error over that of the untouched photo. `removed`: share of the
    squared error that leaves with the least confident fifth of the pixels. `rank`: correlation of
    confidence and squared error, -1 the best. `taken`: of scenes without specular light, the RMS of
    what was taken from the photo over the photo's own.
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
    """Splits the photo by `options.separator`. Raises `InputError`, `Cancelled`."""
    return separate(options.separator, inputs.image, inputs.mask, inputs.clipped, monitor=monitor)


def score_separation(truth: GroundTruth, answer: Separation) -> SeparationScores:
    """The errors of both layers. Raises `ValueError` for an empty mask."""
    mask = truth.mask
    nothing, wrong = mse(truth.diffuse, truth.image, mask), mse(truth.diffuse, answer.diffuse, mask)
    if nothing <= _LEAST:
        return SeparationScores(
            taken=math.sqrt(
                wrong / max(float(np.square(truth.image[mask].astype(float)).mean()), _LEAST)
            )
        )
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
        mse_ratio=wrong / nothing,
        removed=sparsification(squared, confidence).removed(_DROPPED) if sortable else None,
        rank=rank_correlation(confidence, squared) if sortable and np.ptp(confidence) > 0 else None,
    )


def show_separation(truth: GroundTruth, answer: Separation) -> tuple[StagePicture, ...]:
    """True and found layers under one exposure, and the error of the diffuse layer."""
    gain = exposure(truth.image, truth.mask)
    pairs = [
        ("photo", truth.image),
        ("diffuse, true", truth.diffuse),
        ("diffuse, found", answer.diffuse),
    ]
    pairs += [("specular, true", truth.specular), ("specular, found", answer.specular)]
    error = StagePicture(
        "error: orange left over, blue overdone",
        signed_error(gain * (answer.diffuse - truth.diffuse), truth.mask),
    )
    return (
        *(StagePicture(caption, lit(gain * values, truth.mask)) for caption, values in pairs),
        error,
    )


def separation_maps(answer: Separation) -> dict[str, np.ndarray]:
    """Channels of the layers as `isc separate` names them."""
    layers = {"diffuse": answer.diffuse, "specular": answer.specular, "residual": answer.residual}
    planes = {
        f"{name}.{letter}": values[..., k]
        for name, values in layers.items()
        for k, letter in enumerate("RGB")
    }
    return planes | {"confidence.Y": answer.confidence}


def _local(truth: np.ndarray, estimate: np.ndarray, mask: np.ndarray) -> float | None:
    """Grosse's local error, None where a channel of the truth is zero everywhere."""
    if not (truth[mask] > 0).any(axis=0).all():
        return None
    error = lmse(truth, estimate, mask)
    return error if math.isfinite(error) else None


SEPARATION = Stage(
    name="separation",
    title="Separation of diffuse and specular light",
    needs=(),
    metrics=(
        Metric("mse_ratio", "diffuse MSE, of doing nothing"),
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
            "error in the least confident fifth",
            geometric=False,
            larger_is_better=True,
            margin=0.05,
        ),
        Metric("rank", "rank of confidence and error", geometric=False, margin=0.05),
        Metric("taken", "taken from matt scenes, RMS", geometric=False, margin=0.005),
    ),
    run=run_separation,
    score=score_separation,
    show=show_separation,
    maps=separation_maps,
)
