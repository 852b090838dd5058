"""Separations of subjects with known layers: run, timed and scored once for all items.

Errors are those of `isc_core.evaluation`, inside the mask, of linear values; the peak of PSNR and
SSIM is 1. A method with random numbers runs with several seeds, others once.

Citation: LMSE: R. Grosse, M. K. Johnson, E. H. Adelson, W. T. Freeman (2009),
doi:10.1109/ICCV.2009.5459428; SSIM: Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli (2004),
doi:10.1109/TIP.2003.819861.

Limits: for a subject without highlights, doing nothing is right and no ratio to it exists; its
error is given as it is. Seconds depend on the load of the machine: compare those of one table only.
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
    """A separation method with its options, under the thesis' name.

    Attributes
    ----------
    label : str
        Name in tables.
    method : str
        Name of the method in `isc_core.separation`.
    variant : str
        Named set of options.
    changes : tuple of (str, object)
        Options that differ from the variant.
    """

    label: str
    method: str
    variant: str = "improved"
    changes: tuple[tuple[str, object], ...] = ()

    @property
    def key(self) -> str:
        """Name that differs from that of every other setting."""
        return "-".join(
            [self.method, self.variant, *(f"{name}={value}" for name, value in self.changes)]
        )

    def options(self, seed: int) -> dict[str, object]:
        """Return the options of the method.

        Parameters
        ----------
        seed : int
            Added for the method with random numbers.

        Returns
        -------
        dict of str to object
            Options by name.
        """
        return dict(self.changes) | ({"seed": seed} if self.method == SEGMENTATION else {})


NOTHING = SeparatorSetting("doing nothing", "none")


@dataclass(frozen=True)
class SeparationScores:
    """Scores of one run of a setting on one subject; None where not defined or not measured.

    Attributes
    ----------
    subject : str
        Name of the subject.
    setting : str
        Label of the setting.
    run : int
        Number of the run, from 0.
    megapixels : float
        Pixels inside the mask / 1e6.
    mse, lmse, ssim : float or None
        Scores of the diffuse layer.
    specular_mse, specular_lmse, specular_ssim : float or None
        Scores of the specular layer.
    removed : float or None
        RMS of the light removed / RMS of the photo.
    seconds : float or None
        Wall-clock time of the separation.
    search : float or None
        Processor time of the threshold search, seconds.
    exact : bool or None
        Whether the search marks the pixels of the exact search.
    refused : str
        Reason if the method gives no result.
    """

    subject: str
    setting: str
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
    context: Context, subject: Subject, setting: SeparatorSetting, runs: int = 1
) -> list[SeparationScores]:
    """Score repeated runs of a setting on a subject, or load the kept scores.

    Parameters
    ----------
    context : Context
        The run; seeds count up from its seed.
    subject : Subject
        A subject with known layers.
    setting : SeparatorSetting
        The method and its options.
    runs : int
        Number of runs.

    Returns
    -------
    list of SeparationScores
        One entry per run.
    """
    key = f"separation-scores-{subject.kind}-{subject.name}-{setting.key}-{runs}"
    rows: list[dict[str, Any]] = context.rows(
        key, lambda: [asdict(_run(context, subject, setting, run)) for run in range(runs)]
    )
    return [SeparationScores(**row) for row in rows]


def separate_subject(subject: Subject, setting: SeparatorSetting, seed: int) -> Separation:
    """Separate a subject into layers.

    Parameters
    ----------
    subject : Subject
        The subject.
    setting : SeparatorSetting
        The method and its options.
    seed : int
        Random seed.

    Returns
    -------
    Separation
        The layers.

    Raises
    ------
    InputError
        If the method refuses the photo.
    """
    return separate(
        setting.method,
        subject.image,
        subject.mask,
        variant=setting.variant,
        changes=setting.options(seed),
    )


def true_layers(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """Return the true layers of a subject.

    Parameters
    ----------
    subject : Subject
        A subject with a known diffuse layer, or without highlights.

    Returns
    -------
    diffuse, specular : (H, W, 3) ndarray
        The layers.

    Raises
    ------
    InputError
        If the layers are unknown.
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
        f"{subject.name} has no known diffuse layer; choose a subject with known layers"
    )


def segment_highlights(subject: Subject, setting: SeparatorSetting, seed: int) -> np.ndarray:
    """Mark the pixels that a segmentation takes for specular.

    Parameters
    ----------
    subject : Subject
        The subject.
    setting : SeparatorSetting
        A setting of Chaotic Segmentation.
    seed : int
        Random seed.

    Returns
    -------
    (H, W) ndarray
        Boolean.
    """
    peak = max(float(subject.image[subject.mask].max()), 1e-30)
    options = method_options(setting.method, setting.variant, setting.options(seed))
    if not isinstance(options, ChaoticSegmentationOptions):
        raise TypeError(f"{setting.label} is not a segmentation")
    return find_specular((subject.image / peak).astype(np.float32), subject.mask, options)


def layer_errors(subject: Subject, separation: Separation) -> dict[str, Any]:
    """Compute the errors of a separation.

    Parameters
    ----------
    subject : Subject
        A subject with known layers.
    separation : Separation
        The result.

    Returns
    -------
    dict of str to float or None
        Fields of `SeparationScores`.
    """
    mask, inside = subject.mask, subject.mask[..., None]
    diffuse, specular = (
        np.where(inside, layer, 0).astype(np.float64) for layer in true_layers(subject)
    )
    answer, light = (
        np.where(inside, layer, 0).astype(np.float64)
        for layer in (separation.diffuse, separation.specular)
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


def _run(
    context: Context, subject: Subject, setting: SeparatorSetting, run: int
) -> SeparationScores:
    context.monitor.report(f"{setting.label} on {subject.name}, run {run + 1}", 0.0)
    known = SeparationScores(subject.name, setting.label, run, float(subject.mask.sum()) / 1e6)
    try:
        if run == 0:  # warm-up: compilation and imports do not count
            separate_subject(subject, setting, context.seed)
        start = time.perf_counter()
        found = separate_subject(subject, setting, context.seed + run)
        seconds = time.perf_counter() - start
    except InputError as error:
        return replace(known, refused=str(error))
    searched = (
        _searched(subject, setting, context.seed + run) if setting.method == SEGMENTATION else {}
    )
    return replace(known, **layer_errors(subject, found), **searched, seconds=round(seconds, 5))


def _searched(subject: Subject, setting: SeparatorSetting, seed: int) -> dict[str, Any]:
    """Time the threshold search and compare its pixels with those of the exact search.

    The least processor time of three runs: a search uses one thread, so that other load hardly
    counts.
    """
    times = []
    for _ in range(3):
        start = time.process_time()
        marked = segment_highlights(subject, setting, seed)
        times.append(time.process_time() - start)
    best = segment_highlights(
        subject, replace(setting, changes=(*setting.changes, ("optimiser", "exact"))), seed
    )
    return {"search": round(min(times), 6), "exact": bool((marked == best).all())}
