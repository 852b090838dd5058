"""What separations make of subjects whose layers are known: run, timed and scored once, for all
tables and figures that need them.

Errors are those of `isc_core.evaluation.metrics` and `isc_core.evaluation.image_metrics`, inside the mask, of linear
values; the peak of PSNR and SSIM is 1. A method that draws random numbers is run with several
seeds, the others once.

Citation: LMSE: R. Grosse, M. K. Johnson, E. H. Adelson, W. T. Freeman (2009),
doi:10.1109/ICCV.2009.5459428; SSIM: Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli (2004),
doi:10.1109/TIP.2003.819861.

Limits: of a subject without highlights no ratio to doing nothing exists, since doing nothing is
right; its error is given as such. Seconds are of the machine as it was: compare those of one run of
a table only.
"""

import math
import time
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from isc_core.errors import InputError
from isc_core.evaluation.image_metrics import ssim
from isc_core.evaluation.metrics import lmse, mse
from isc_core.scene.decomposition import Separation
from isc_core.separation import method_options, separate
from isc_core.separation.chaotic_segmentation import ChaoticSegmentationOptions, find_specular

from ..images.subject import Subject
from .context import Context

SEGMENTATION = "chaotic_segmentation"


@dataclass(frozen=True)
class SeparatorSetting:
    """A separation under the name that the thesis has for it:

    `label`; `method`, `variant` and the options that differ from it.
    """

    label: str
    method: str
    variant: str = "improved"
    changes: tuple[tuple[str, object], ...] = ()

    @property
    def key(self) -> str:
        """A name that differs from that of every other way."""
        return "-".join(
            [self.method, self.variant, *(f"{name}={value}" for name, value in self.changes)]
        )

    def options(self, seed: int) -> dict[str, object]:
        """The options by name; the seed goes to the method that draws random numbers."""
        return dict(self.changes) | ({"seed": seed} if self.method == SEGMENTATION else {})


NOTHING = SeparatorSetting("doing nothing", "none")


@dataclass(frozen=True)
class SeparationScores:
    """One run of a way on one subject; None: not defined, or not measured.

    `mse`, `lmse`, `ssim` of the diffuse layer; `specular_*` of the specular one. `removed`: RMS of
    what was taken off over the photo's RMS. `seconds` of the whole; `search`: processor seconds of
    finding the highlights' mask by thresholds; `exact`: whether those are the pixels that the exact
    search marks; `megapixels` inside the mask; `refused`: why there is no answer.
    """

    subject: str
    way: str
    run: int
    megapixels: float
    mse: float | None = None
    lmse: float | None = None
    ssim: float | None = None
    specular_mse: float | None = None
    specular_lmse: float | None = None
    specular_ssim: float | None = None
    removed: float | None = None
    seconds: float | None = None
    search: float | None = None
    exact: bool | None = None
    refused: str = ""


def score_separations(
    context: Context, subject: Subject, way: SeparatorSetting, runs: int = 1
) -> list[SeparationScores]:
    """The scores of `runs` runs, seeds counting on from the context's. Kept, see `Context.rows`."""
    key = f"separation-{subject.kind}-{subject.name}-{way.key}-{runs}"
    rows: list[dict[str, Any]] = context.rows(
        key, lambda: [asdict(_run(context, subject, way, run)) for run in range(runs)]
    )
    return [SeparationScores(**row) for row in rows]


def separate_subject(subject: Subject, way: SeparatorSetting, seed: int) -> Separation:
    """The layers that a way finds. Raises `InputError` where the method refuses the photo."""
    return separate(
        way.method, subject.image, subject.mask, variant=way.variant, changes=way.options(seed)
    )


def true_layers(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """The true diffuse and specular layer; of a subject without highlights the photo and nothing.

    Raises `InputError` for a subject whose layers nobody knows.
    """
    if subject.diffuse is not None:
        specular = (
            np.maximum(subject.image - subject.diffuse, 0)
            if subject.specular is None
            else subject.specular
        )
        return subject.diffuse, specular
    if subject.kind == "diffuse":
        return subject.image, np.zeros_like(subject.image)
    raise InputError(
        f"{subject.name} has no true diffuse layer: choose a subject whose layers are known"
    )


def segment_highlights(subject: Subject, way: SeparatorSetting, seed: int) -> np.ndarray:
    """The pixels (H, W) bool that a segmentation takes for specular."""
    peak = max(float(subject.image[subject.mask].max()), 1e-30)
    options = method_options(way.method, way.variant, way.options(seed))
    if not isinstance(options, ChaoticSegmentationOptions):
        raise TypeError(f"{way.label} is no segmentation")
    return find_specular((subject.image / peak).astype(np.float32), subject.mask, options)


def layer_errors(subject: Subject, found: Separation) -> dict[str, Any]:
    """The errors of an answer, by the names of `Scores`."""
    mask, inside = subject.mask, subject.mask[..., None]
    diffuse, specular = (
        np.where(inside, layer, 0).astype(np.float64) for layer in true_layers(subject)
    )
    answer, light = (
        np.where(inside, layer, 0).astype(np.float64) for layer in (found.diffuse, found.specular)
    )
    photo = np.where(inside, subject.image, 0).astype(np.float64)
    glossy = bool((specular[mask] > 0).any(axis=0).all())
    return {
        "mse": mse(diffuse, answer, mask),
        "lmse": lmse(diffuse, answer, mask),
        "ssim": ssim(diffuse, answer, mask),
        "specular_mse": mse(specular, light, mask),
        "specular_lmse": lmse(specular, light, mask) if glossy else None,
        "specular_ssim": ssim(specular, light, mask),
        "removed": math.sqrt(
            mse(photo, answer, mask) / max(mse(photo, np.zeros_like(photo), mask), 1e-30)
        ),
    }


def _run(context: Context, subject: Subject, way: SeparatorSetting, run: int) -> SeparationScores:
    context.monitor.report(f"{way.label} on {subject.name}, run {run + 1}", 0.0)
    known = SeparationScores(subject.name, way.label, run, float(subject.mask.sum()) / 1e6)
    try:
        if run == 0:  # what is compiled or imported at the first call shall not count
            separate_subject(subject, way, context.seed)
        start = time.perf_counter()
        found = separate_subject(subject, way, context.seed + run)
        seconds = time.perf_counter() - start
    except InputError as error:
        return replace(known, refused=str(error))
    searched = _searched(subject, way, context.seed + run) if way.method == SEGMENTATION else {}
    return replace(known, **layer_errors(subject, found), **searched, seconds=round(seconds, 5))


def _searched(subject: Subject, way: SeparatorSetting, seed: int) -> dict[str, Any]:
    """How long the search for thresholds takes, and whether it ends where the exact one does.

    The least processor time of three runs: a search runs on one thread, so that what else the
    machine does hardly counts.
    """
    times = []
    for _ in range(3):
        start = time.process_time()
        marked = segment_highlights(subject, way, seed)
        times.append(time.process_time() - start)
    best = segment_highlights(
        subject, replace(way, changes=(*way.changes, ("optimiser", "exact"))), seed
    )
    return {"search": round(min(times), 6), "exact": bool((marked == best).all())}
