"""Tables of separations: accuracy of the diffuse or the specular layer, by subject, and speed.

Equation: the error of a subject counts relative to doing nothing (diffuse = photo, specular = 0);
subjects are summarised by geometric means, so that no single dark or bright image decides. Images
without highlights have no such ratio: the share of light removed is reported instead.

Limits: where doing nothing is right, PSNR is infinite; PSNR of a mean is that of the mean error.
Means of a method that refuses subjects are over the others, so that they compare with its ratios
only; its row says how many it refuses.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from isc_core.evaluation.metrics import geometric_mean

from ..measuring.context import Context
from ..measuring.separation_scores import (
    NOTHING,
    SeparationScores,
    SeparatorSetting,
    score_separations,
)
from .comparing import format_ratio, label_with_refusals, paired_ratio, rank_sum_p
from .item import Cell, ItemTable

KINDS = {
    "specular": "significant specularity",
    "synthetic": "synthetic images",
    "diffuse": "images without specularity",
}
# Fields of `SeparationScores`: mean square error, local error, structural similarity.
LayerFields = tuple[str, str, str]
DIFFUSE, SPECULAR = ("mse", "lmse", "ssim"), ("specular_mse", "specular_lmse", "specular_ssim")
RunScores = dict[str, dict[str, list[SeparationScores]]]  # setting label -> subject name -> runs
Reference = Callable[[str], str | None]  # label of a setting -> label of the one to compare with


def score_settings(
    context: Context, kind: str, settings: Sequence[SeparatorSetting], runs: int = 1
) -> RunScores:
    """Score doing nothing and several settings on all subjects of a kind.

    Parameters
    ----------
    context : Context
        The run; scores are kept in its output folder.
    kind : str
        One of `KINDS`.
    settings : sequence of SeparatorSetting
        Methods with their options.
    runs : int
        Runs per setting and subject.

    Returns
    -------
    RunScores
        Scores by setting and subject, doing nothing first.
    """
    subjects = context.subjects(kind)
    scores: RunScores = {
        NOTHING.label: {
            subject.name: score_separations(context, subject, NOTHING) for subject in subjects
        }
    }
    for setting in settings:
        scores[setting.label] = {
            subject.name: score_separations(context, subject, setting, runs) for subject in subjects
        }
    return scores


def mean_scores(subjects: Mapping[str, Sequence[SeparationScores]], field: str) -> dict[str, float]:
    """Average a score over the runs of each subject.

    Parameters
    ----------
    subjects : mapping of str to sequence of SeparationScores
        Runs by subject.
    field : str
        A field of `SeparationScores`.

    Returns
    -------
    dict of str to float
        Means by subject; subjects without a value are omitted.
    """
    values = {
        subject: drop_missing([getattr(run, field) for run in runs])
        for subject, runs in subjects.items()
    }
    return {subject: sum(each) / len(each) for subject, each in values.items() if each}


def relative_error(runs: RunScores, label: str, kind: str, layer: LayerFields, seed: int) -> str:
    """Format a layer's error relative to doing nothing.

    Parameters
    ----------
    runs : RunScores
        Scores of all settings.
    label : str
        The setting.
    kind : str
        One of `KINDS`.
    layer : LayerFields
        `DIFFUSE` or `SPECULAR`.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    str
        Ratio and interval; for images without highlights, the light removed in per cent.
    """
    if kind == "diffuse":
        removed = mean_or_none(mean_scores(runs[label], "removed").values())
        return format_cell(None if removed is None else 100 * removed, ".2f")
    if label == NOTHING.label:
        return "1"
    ours, nothing = (mean_scores(runs[one], layer[0]) for one in (label, NOTHING.label))
    return format_ratio(paired_ratio(ours, nothing, seed))


def accuracy_table(
    runs: RunScores,
    kind: str,
    layer: LayerFields,
    seed: int,
    reference: Reference | None = None,
    reference_label: str = "",
) -> ItemTable:
    """Summarise the accuracy of a layer over all subjects, one row per setting.

    Parameters
    ----------
    runs : RunScores
        Scores of all settings.
    kind : str
        One of `KINDS`.
    layer : LayerFields
        `DIFFUSE` or `SPECULAR`.
    seed : int
        Seed of the bootstrap.
    reference : callable, optional
        Selects the setting that a setting is also compared with.
    reference_label : str
        Name of the reference in the header.

    Returns
    -------
    ItemTable
        Relative error, LMSE, PSNR and SSIM.
    """
    first = "removed, % of the RMS" if kind == "diffuse" else "MSE / doing nothing (95 %)"
    rows = []
    for label, subjects in runs.items():
        error, local, similarity = (mean_scores(subjects, field) for field in layer)
        level = mean_or_none(error.values())
        more = () if reference is None else (_compared(runs, label, layer[0], reference, seed),)
        rows.append(
            (
                _with_refusals(label, subjects),
                relative_error(runs, label, kind, layer, seed),
                format_cell(times_thousand(mean_or_none(local.values()))),
                format_cell(None if level is None else decibels(level), ".2f"),
                format_cell(mean_or_none(similarity.values()), ".4f"),
                *more,
            )
        )
    more_header = () if reference is None else (f"MSE / {reference_label} (95 %)",)
    count = len(runs[NOTHING.label])
    return ItemTable(
        ("method", first, "LMSE x 1000", "PSNR, dB", "SSIM", *more_header),
        tuple(rows),
        f"The {_layer_name(layer)} layer, {count} subjects, {KINDS[kind]}",
    )


def _with_refusals(label: str, subjects: Mapping[str, Sequence[SeparationScores]]) -> str:
    """Add the number of subjects that a method refuses, which its means do not contain."""
    refused = sum(any(run.refused for run in runs) for runs in subjects.values())
    return label_with_refusals(label, refused, len(subjects))


def _layer_name(layer: LayerFields) -> str:
    return "diffuse" if layer is DIFFUSE else "specular"


def _compared(
    runs: RunScores,
    label: str,
    field: str,
    reference: Reference,
    seed: int,
    object_of: Callable[[str], str] = str,
) -> str:
    other = reference(label)
    if other is None or other == label:
        return "-"
    return format_ratio(
        paired_ratio(
            mean_scores(runs[label], field), mean_scores(runs[other], field), seed, object_of
        )
    )


def subject_table(
    runs: RunScores,
    kind: str,
    layer: LayerFields,
    reference: Reference | None = None,
    reference_label: str = "",
) -> ItemTable:
    """List the accuracy of a layer, one row per subject and setting.

    Parameters
    ----------
    runs : RunScores
        Scores of all settings. Repeated runs add their deviation and a rank-sum test.
    kind : str
        One of `KINDS`.
    layer : LayerFields
        `DIFFUSE` or `SPECULAR`.
    reference : callable, optional
        Selects the setting of the rank-sum test.
    reference_label : str
        Name of the reference in the header.

    Returns
    -------
    ItemTable
        Errors as they are; "refused" where a method gives no result.
    """
    repeated = any(len(each) > 1 for subjects in runs.values() for each in subjects.values())
    more = ("runs", "deviation of the MSE", f"p against {reference_label}") if repeated else ()
    rows = []
    for subject in runs[NOTHING.label]:
        for label, subjects in runs.items():
            cells: tuple[Cell, ...] = (subject, label, *_errors(subjects[subject], layer))
            if repeated:
                other = None if reference is None else reference(label)
                compared = None
                if other is not None and other != label:
                    compared = drop_missing(
                        [getattr(run, layer[0]) for run in runs[other][subject]]
                    )
                cells = (*cells, *_deviation(subjects[subject], layer[0], compared))
            rows.append(cells)
    return ItemTable(
        ("subject", "method", "MSE", "LMSE x 1000", "PSNR, dB", "SSIM", *more),
        tuple(rows),
        f"The {_layer_name(layer)} layer by subject, {KINDS[kind]}",
    )


def speed_table(
    runs: RunScores,
    reference: Reference,
    seed: int,
    reference_label: str,
    *,
    search: bool = True,
    object_of: Callable[[str], str] = str,
) -> ItemTable:
    """Summarise run times, one row per setting.

    Parameters
    ----------
    runs : RunScores
        Scores of all settings.
    reference : callable
        Selects the setting that a setting is compared with.
    seed : int
        Seed of the bootstrap.
    reference_label : str
        Name of the reference in the header.
    search : bool
        Whether to list the time of the threshold search separately, where there is one.
    object_of : callable, optional
        Returns the object that a subject shows; by default, each shows another one.

    Returns
    -------
    ItemTable
        Milliseconds, megapixels per second and ratios to the reference.
    """
    searched = search and any(
        run.search is not None
        for subjects in runs.values()
        for each in subjects.values()
        for run in each
    )
    names = {"search": "search", "seconds": "total"} if searched else {"seconds": "total"}
    rows = []
    for label, subjects in runs.items():
        rates = [
            run.megapixels / run.seconds
            for each in subjects.values()
            for run in each
            if run.seconds
        ]
        times = [
            format_cell(times_thousand(geometric_or_none(mean_scores(subjects, name).values())))
            for name in names
        ]
        ratios = (_compared(runs, label, name, reference, seed, object_of) for name in names)
        rows.append(
            (
                _with_refusals(label, subjects),
                *times,
                format_cell(geometric_or_none(rates)),
                *ratios,
            )
        )
    header = (
        "method",
        *(f"{what}, ms" for what in names.values()),
        "megapixels per second",
        *(f"{what} / {reference_label} (95 %)" for what in names.values()),
    )
    return ItemTable(
        header,
        tuple(rows),
        "Geometric means over the subjects of the run times, after a warm-up run",
    )


def decibels(error: float) -> float:
    """Convert a mean square error to PSNR.

    Parameters
    ----------
    error : float
        Mean square error, peak value 1.

    Returns
    -------
    float
        Decibels; infinite for an error of 0.
    """
    return math.inf if error == 0 else -10 * math.log10(error)


def format_cell(value: float | None, form: str = ".4g") -> str:
    """Format a number for a table.

    Parameters
    ----------
    value : float or None
        The number.
    form : str
        Format specification.

    Returns
    -------
    str
        The number; a dash for None.
    """
    return "-" if value is None else "∞" if math.isinf(value) else format(value, form)


def drop_missing(values: Sequence[float | None]) -> list[float]:
    """Return the values that are not None.

    Parameters
    ----------
    values : sequence of (float or None)

    Returns
    -------
    list of float
        In the same order.
    """
    return [value for value in values if value is not None]


def mean_or_none(values: Iterable[float]) -> float | None:
    """Return the arithmetic mean.

    Parameters
    ----------
    values : iterable of float

    Returns
    -------
    float or None
        None without values.
    """
    each = list(values)
    return sum(each) / len(each) if each else None


def geometric_or_none(values: Iterable[float]) -> float | None:
    """Return the geometric mean.

    Parameters
    ----------
    values : iterable of float
        Positive.

    Returns
    -------
    float or None
        None without values.
    """
    each = list(values)
    return geometric_mean(each) if each else None


def times_thousand(value: float | None) -> float | None:
    """Return a thousand times a value.

    Parameters
    ----------
    value : float or None

    Returns
    -------
    float or None
        None stays None.
    """
    return None if value is None else 1000 * value


def _errors(runs: Sequence[SeparationScores], layer: LayerFields) -> tuple[Cell, ...]:
    error, local, similarity = (
        mean_or_none(drop_missing([getattr(run, field) for run in runs])) for field in layer
    )
    if error is None:
        return ("refused", "-", "-", "-")
    return (
        error,
        format_cell(times_thousand(local)),
        format_cell(decibels(error), ".2f"),
        format_cell(similarity, ".4f"),
    )


def _deviation(
    runs: Sequence[SeparationScores], field: str, compared: list[float] | None
) -> tuple[Cell, ...]:
    errors = drop_missing([getattr(run, field) for run in runs])
    if len(errors) < 2:
        return (len(runs), "-", "-")
    level = sum(errors) / len(errors)
    deviation = math.sqrt(sum((error - level) ** 2 for error in errors) / (len(errors) - 1))
    p = rank_sum_p(errors, compared) if compared else None
    return (len(runs), deviation, format_cell(p, ".2g"))
