"""Decompositions of subjects, kept as result folders below the output and shared by items.

Limits: photos of unknown coding count as linear floats; if no value exceeds 1, values of 1 count as
clipped.
"""

import numpy as np

from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.decomposition.settings import Illumination
from isc_core.photo import FLOAT_STEP, Photo, PhotoSource
from isc_core.result_files.result_folder import load, save
from isc_core.scene.decomposition import Decomposition

from ..images.subject import Subject
from .context import WORK, Context


def subject_as_photo(subject: Subject) -> Photo:
    """Convert a subject to a photo.

    Parameters
    ----------
    subject : Subject
        The subject.

    Returns
    -------
    Photo
        Input of a decomposition model.
    """
    bright = subject.image[subject.mask]
    height, width = subject.mask.shape
    clipped = subject.mask & (subject.image.max(axis=2) >= 1) & (float(bright.max()) <= 1)
    source = PhotoSource("", (width, height), 32, "linear", "file")
    return Photo(
        subject.image.astype(np.float32),
        subject.mask,
        FLOAT_STEP * float(np.quantile(bright, 0.999)),
        clipped,
        source,
    )


def illumination_of(subject: Subject) -> str:
    """Return the light prior of a subject: that of its ground truth, or the default of photos.

    Parameters
    ----------
    subject : Subject
        The subject.

    Returns
    -------
    str
        A value of `--illumination`.
    """
    return str(Illumination.PHOTO if subject.truth is None else subject.truth.illumination)


def decompose_subject(
    context: Context, subject: Subject, model: str = "mdr", illumination: str | None = None
) -> Decomposition:
    """Decompose a subject at its own resolution, or load the kept result.

    Parameters
    ----------
    context : Context
        The run.
    subject : Subject
        The subject.
    model : str
        One of `pipeline.MODELS`.
    illumination : str, optional
        Light prior; by default `illumination_of` the subject.

    Returns
    -------
    Decomposition
        The result as saved.

    Raises
    ------
    InputError
        If the model refuses the photo.
    Cancelled
        If the user cancels.
    """
    lit = illumination or illumination_of(subject)
    folder = (
        context.output
        / WORK
        / "decompositions"
        / f"{subject.kind}-{subject.name}-{model}-{lit}-{context.fingerprint}"
    )
    record = folder / "decomposition.json"
    if record.is_file() and record.stat().st_mtime >= context.fresh_since:
        return load(folder)
    settings = Settings(model=model, illumination=lit, max_size=0, seed=context.seed, threads=2)
    found = decompose(
        subject_as_photo(subject), settings, name=subject.name, monitor=context.monitor
    )
    folder.parent.mkdir(parents=True, exist_ok=True)
    save(found, folder)
    return load(folder)
