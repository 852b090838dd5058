"""Frameworks on subjects with known shape and light: run and timed once, kept with their maps.

SIRFS-X separates the reflectance of a SIRFS result by X (model mbp); X-SIRFS separates first and
gives SIRFS the diffuse image (model mdr). SIRFS-MBP and MDR-SIRFS use the separation of ISC.

Citation: H. Akbar, thesis (2016); J. T. Barron, J. Malik (2015), doi:10.1109/TPAMI.2014.2377712.

Limits: the priors were fitted to objects of MIT-Berkeley: all frameworks are somewhat better on
these objects than elsewhere. Seconds depend on the load of the machine; evaluations of the energy
do not.
"""

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache

import numpy as np

from isc_core.datasets.mit_berkeley import MitBerkeleyObject
from isc_core.errors import InputError
from isc_core.evaluation.evaluate import Estimate
from isc_core.evaluation.metrics import score
from isc_core.evaluation.runner import RunnerOptions, make_runner
from isc_core.io.atomic import new_file
from isc_core.progress import Monitor
from isc_core.separation import BEST
from isc_core.sirfs.priors.prior_file import shipped_prior_set

from ..images.subject import Subject, downsample_subject
from .context import WORK, Context

METRICS = ("height", "normal", "light", "shading", "reflectance", "rs_mse", "average")
_MAPS = ("height", "normal", "shading", "reflectance", "light")
_WARM = 24  # pixels, the side of what is run before the clock runs
_QUICK = 64  # longest side, pixels


@dataclass(frozen=True)
class Framework:
    """A framework under the thesis' name.

    Attributes
    ----------
    label : str
        Name in tables.
    model : str
        Decomposition model.
    separator : str
        Separation method.
    on_truth : bool
        Use the true diffuse image, as a bound.
    """

    label: str
    model: str
    separator: str = BEST
    on_truth: bool = False


SIRFS = Framework("SIRFS", "sirfs")
BOUND = Framework("SIRFS on the true diffuse image", "sirfs", on_truth=True)
AFTER = (
    Framework("SIRFS-MZK06", "mbp", "mallick_2006"),
    Framework("SIRFS-YCK06", "mbp", "yoon_2006"),
    Framework("SIRFS-MBP", "mbp"),
)
BEFORE = (
    Framework("MZK06-SIRFS", "mdr", "mallick_2006"),
    Framework("YCK06-SIRFS", "mdr", "yoon_2006"),
    Framework("SC-SIRFS", "mdr", "sparse_coding"),
    Framework("MDR-SIRFS", "mdr"),
    Framework("joint", "joint"),
)


@dataclass(frozen=True)
class FrameworkRun:
    """One framework on one subject.

    Attributes
    ----------
    answer : Estimate or None
        The result; None if the photo was refused.
    seconds : float
        Wall-clock time.
    """

    answer: Estimate | None
    seconds: float


@dataclass(frozen=True)
class FrameworkErrors:
    """Errors of one run.

    Attributes
    ----------
    subject : str
        Kind and name of the subject.
    framework : str
        Label of the framework.
    errors : dict of str to float
        Errors by the names of `METRICS`.
    seconds : float
        Wall-clock time.
    evaluations : int
        Evaluations of the energy.
    """

    subject: str
    framework: str
    errors: dict[str, float]
    seconds: float
    evaluations: int


def subjects_with_truth(context: Context, kinds: Sequence[str]) -> list[Subject]:
    """Load the subjects with known shape and light; a quick run reduces them further.

    Parameters
    ----------
    context : Context
        The run.
    kinds : sequence of str
        Kinds of subjects, see `Context.subjects`.

    Returns
    -------
    list of Subject
        The subjects.
    """
    found = [
        subject for kind in kinds for subject in context.subjects(kind) if subject.truth is not None
    ]
    return [downsample_subject(subject, _QUICK) for subject in found] if context.quick else found


def score_frameworks(
    context: Context, subjects: Sequence[Subject], frameworks: Sequence[Framework]
) -> list[FrameworkErrors]:
    """Score frameworks on subjects; refused photos are omitted.

    Parameters
    ----------
    context : Context
        The run.
    subjects : sequence of Subject
        Subjects with ground truth.
    frameworks : sequence of Framework
        The frameworks.

    Returns
    -------
    list of FrameworkErrors
        One entry per framework and subject.
    """
    rows = []
    for subject in subjects:
        assert subject.truth is not None
        for framework in frameworks:
            run = run_framework(context, subject, framework)
            if run.answer is not None:
                scores = score(subject.truth, **{name: getattr(run.answer, name) for name in _MAPS})
                errors = asdict(scores) | {"average": scores.average}
                rows.append(
                    FrameworkErrors(
                        f"{subject.kind} {subject.name}",
                        framework.label,
                        errors,
                        run.seconds,
                        run.answer.evaluations or 0,
                    )
                )
    return rows


def run_framework(context: Context, subject: Subject, framework: Framework) -> FrameworkRun:
    """Run a framework on a subject, or load the kept result.

    Parameters
    ----------
    context : Context
        The run.
    subject : Subject
        A subject with ground truth.
    framework : Framework
        The framework.

    Returns
    -------
    FrameworkRun
        The result with its time.

    Raises
    ------
    InputError
        If the subject has no ground truth.
    Cancelled
        If the user cancels.
    """
    name = f"{subject.kind}-{subject.name}-{framework.label}-{context.fingerprint}.npz".replace(
        " ", "-"
    )
    path = context.output / WORK / "estimates" / name
    if path.is_file() and path.stat().st_mtime >= context.fresh_since:
        with np.load(path, allow_pickle=False) as kept:
            return _restored({key: kept[key] for key in kept.files})
    context.monitor.report(f"{framework.label} on {subject.name}", 0.0)
    run = _timed(context, subject, framework)
    with new_file(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, **_arrays(run))
    return run


def _timed(context: Context, subject: Subject, framework: Framework) -> FrameworkRun:
    _warm(framework.model, framework.separator)
    runner = make_runner(
        RunnerOptions(framework.model, framework.separator, threads=2), shipped_prior_set()
    )
    begun = time.perf_counter()
    try:
        answer = runner(_input(subject, framework), context.monitor)
    except InputError:
        return FrameworkRun(None, 0.0)
    return FrameworkRun(answer, time.perf_counter() - begun)


@cache
def _warm(model: str, separator: str) -> None:
    """Run a framework on a small ball, so that compilation and file reading are not timed."""
    axis = np.linspace(-1.2, 1.2, _WARM)
    distance = np.hypot(axis, axis[:, None])
    mask, height = distance < 1, np.sqrt(np.maximum(0, 1 - distance**2)) * _WARM / 2.4
    image = np.where(
        mask[..., None], (0.2 + 0.4 * height[..., None] / height.max()) * [1, 0.4, 0.2], 0
    )
    ball = MitBerkeleyObject(
        "ball", "natural", image, mask, mask, height, image, image, np.zeros((9, 3))
    )
    make_runner(RunnerOptions(model, separator, threads=2), shipped_prior_set())(ball, Monitor())


def _input(subject: Subject, framework: Framework) -> MitBerkeleyObject:
    """Return the framework's input: the photo, or the true diffuse image."""
    if subject.truth is None:
        raise InputError(f"{subject.name} has no known shape; choose a subject with ground truth")
    if not framework.on_truth:
        return subject.truth
    if subject.diffuse is None:
        raise InputError(
            f"{subject.name} has no known diffuse layer; choose a subject with known layers"
        )
    image = subject.diffuse.astype(float)
    return replace(subject.truth, image=image, valid=subject.truth.valid & (image > 0).all(axis=-1))


def _arrays(run: FrameworkRun) -> dict[str, np.ndarray]:
    if run.answer is None:
        return {"seconds": np.array(run.seconds)}
    maps = {name: np.asarray(getattr(run.answer, name), np.float32) for name in _MAPS}
    return maps | {
        "seconds": np.array(run.seconds),
        "evaluations": np.array(run.answer.evaluations or 0),
    }


def _restored(kept: dict[str, np.ndarray]) -> FrameworkRun:
    if "height" not in kept:
        return FrameworkRun(None, float(kept["seconds"]))
    height, normal, shading, reflectance, light = (kept[name].astype(float) for name in _MAPS)
    answer = Estimate(
        height, normal, shading, reflectance, light, evaluations=int(kept["evaluations"])
    )
    return FrameworkRun(answer, float(kept["seconds"]))
