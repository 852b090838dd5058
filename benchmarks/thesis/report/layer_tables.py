"""Tables of separations: accuracy of the diffuse or of the specular layer, and speed, over all
subjects and one by one.

The error of one subject counts relative to doing nothing (diffuse = photo, specular = none), and
subjects are summed up by geometric means, so that no dark or bright one decides; images without
highlights have no such ratio, and what was taken off them is told instead.

Limits: where doing nothing is right, PSNR is infinite, and a mean over subjects is of their errors,
not of decibels.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from isc_core.metrics import geometric_mean

from .comparing import in_words, rank_sum, ratio
from .context import Context
from .item import Cell, Table
from .separations import NOTHING, Scores, Way, measured

KINDS = {
    "specular": "significant specularity",
    "synthetic": "synthetic images",
    "matt": "images without specularity",
}
Layer = tuple[
    str, str, str
]  # the fields of `Scores`: mean square error, local error, structural similarity
DIFFUSE, SPECULAR = ("mse", "lmse", "ssim"), ("specular_mse", "specular_lmse", "specular_ssim")
Runs = dict[str, dict[str, list[Scores]]]  # of each way's label: of each subject's name: the runs
Against = Callable[[str], str | None]  # the label of the way that a way is compared with


def run_all(context: Context, kind: str, ways: Sequence[Way], runs: int = 1) -> Runs:
    """Doing nothing, and all ways, on all subjects of a kind."""
    subjects = context.subjects(kind)
    found: Runs = {
        NOTHING.label: {subject.name: measured(context, subject, NOTHING) for subject in subjects}
    }
    for way in ways:
        found[way.label] = {
            subject.name: measured(context, subject, way, runs) for subject in subjects
        }
    return found


def means(of_subjects: Mapping[str, Sequence[Scores]], name: str) -> dict[str, float]:
    """The mean of a subject's runs, for each subject that has one."""
    found = {
        subject: present([getattr(run, name) for run in runs])
        for subject, runs in of_subjects.items()
    }
    return {subject: sum(values) / len(values) for subject, values in found.items() if values}


def relative(runs: Runs, label: str, kind: str, layer: Layer, seed: int) -> str:
    """How much a layer errs: over doing nothing, with its interval, or, where nothing is to be
    done, the share of light taken off.
    """
    if kind == "matt":
        taken = average(means(runs[label], "removed").values())
        return number(None if taken is None else 100 * taken, ".2f")
    return (
        "1"
        if label == NOTHING.label
        else in_words(
            ratio(means(runs[label], layer[0]), means(runs[NOTHING.label], layer[0]), seed)
        )
    )


def summary(
    runs: Runs, kind: str, layer: Layer, seed: int, against: Against | None = None, words: str = ""
) -> Table:
    """A line a way, over all subjects;

    `against` which others it is also compared with, in `words`.
    """
    first = "taken off, % of the RMS" if kind == "matt" else "MSE over doing nothing (95 %)"
    which = "diffuse" if layer is DIFFUSE else "specular"
    lines = []
    for label, found in runs.items():
        error, local, alike = (means(found, name) for name in layer)
        level = average(error.values())
        more = () if against is None else (_beside(runs, label, layer[0], against, seed),)
        lines.append(
            (
                label,
                relative(runs, label, kind, layer, seed),
                number(thousand(average(local.values()))),
                number(None if level is None else decibels(level), ".2f"),
                number(average(alike.values()), ".4f"),
                *more,
            )
        )
    header = (
        "method",
        first,
        "LMSE x 1000",
        "PSNR, dB",
        "SSIM",
        *(() if against is None else (f"MSE over that of {words} (95 %)",)),
    )
    return Table(
        header,
        tuple(lines),
        f"The {which} layer against the truth, {len(runs[NOTHING.label])} subjects, {KINDS[kind]}",
    )


def _beside(runs: Runs, label: str, name: str, against: Against, seed: int) -> str:
    other = against(label)
    return (
        "-"
        if other is None or other == label
        else in_words(ratio(means(runs[label], name), means(runs[other], name), seed))
    )


def by_subject(
    runs: Runs, kind: str, layer: Layer, against: Against | None = None, words: str = ""
) -> Table:
    """A line a way and subject; where runs are repeated, their means and deviations, and rank-sum
    tests against another way.
    """
    repeated = any(len(found) > 1 for of in runs.values() for found in of.values())
    more = ("runs", "deviation of the MSE", f"p against {words}") if repeated else ()
    lines = []
    for subject in runs[NOTHING.label]:
        for label, found in runs.items():
            other = None if against is None else against(label)
            beside = (
                None
                if other is None or other == label
                else present([getattr(run, layer[0]) for run in runs[other][subject]])
            )
            lines.append(
                (
                    subject,
                    label,
                    *_errors(found[subject], layer),
                    *(_repeated(found[subject], layer[0], beside) if repeated else ()),
                )
            )
    caption = f"The {'diffuse' if layer is DIFFUSE else 'specular'} layer by subject, {KINDS[kind]}"
    return Table(
        ("subject", "method", "MSE", "LMSE x 1000", "PSNR, dB", "SSIM", *more),
        tuple(lines),
        caption,
    )


def speed(runs: Runs, against: Against, seed: int, words: str) -> Table:
    """A line a way: geometric means over the subjects, warm; the search for thresholds apart, where
    there is one.
    """
    searched = any(
        run.search is not None for of in runs.values() for found in of.values() for run in found
    )
    names = {"search": "search", "seconds": "whole"} if searched else {"seconds": "whole"}
    lines = []
    for label, found in runs.items():
        rates = [run.megapixels / run.seconds for of in found.values() for run in of if run.seconds]
        times = [number(thousand(middle(means(found, name).values()))) for name in names]
        lines.append(
            (
                label,
                *times,
                number(middle(rates)),
                *(_beside(runs, label, name, against, seed) for name in names),
            )
        )
    compared = (f"{what} over that of {words} (95 %)" for what in names.values())
    header = (
        "method",
        *(f"{what}, ms" for what in names.values()),
        "megapixels a second",
        *compared,
    )
    return Table(
        header,
        tuple(lines),
        "Geometric means over the subjects of the runs' mean times, warm, on this machine",
    )


def decibels(error: float) -> float:
    """PSNR of a mean square error, dB, peak 1; infinite for none."""
    return math.inf if error == 0 else -10 * math.log10(error)


def number(value: float | None, form: str = ".4g") -> str:
    """A cell of a table; a dash where there is no value."""
    return "-" if value is None else "∞" if math.isinf(value) else format(value, form)


def present(values: Sequence[float | None]) -> list[float]:
    """Those values that there are."""
    return [value for value in values if value is not None]


def average(values: Iterable[float]) -> float | None:
    """The arithmetic mean; None of nothing."""
    found = list(values)
    return sum(found) / len(found) if found else None


def middle(values: Iterable[float]) -> float | None:
    """The geometric mean; None of nothing."""
    found = list(values)
    return geometric_mean(found) if found else None


def thousand(value: float | None) -> float | None:
    """A thousand times a value, where there is one."""
    return None if value is None else 1000 * value


def _errors(runs: Sequence[Scores], layer: Layer) -> tuple[Cell, ...]:
    error, local, alike = (average(present([getattr(run, name) for run in runs])) for name in layer)
    if error is None:
        return ("refused", "-", "-", "-")
    return (error, number(thousand(local)), number(decibels(error), ".2f"), number(alike, ".4f"))


def _repeated(runs: Sequence[Scores], name: str, beside: list[float] | None) -> tuple[Cell, ...]:
    errors = present([getattr(run, name) for run in runs])
    if len(errors) < 2:
        return (len(runs), "-", "-")
    level = sum(errors) / len(errors)
    deviation = math.sqrt(sum((error - level) ** 2 for error in errors) / (len(errors) - 1))
    return (len(runs), deviation, number(rank_sum(errors, beside) if beside else None, ".2g"))
