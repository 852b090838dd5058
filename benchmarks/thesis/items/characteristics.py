"""Tables 4.19 to 4.22: shape, light, shading and reflectance by the frameworks, relative to SIRFS.

Problem: 4.19 and 4.20 run SIRFS first and separate its reflectance; 4.21 and 4.22 separate first.
Of each pair, the first table has errors and the second time. Subjects: glossy photos and rendered
scenes with known shape and light. Two rows are added: `joint`, this project's model, and SIRFS on
the true diffuse image, which is the result of a perfect separation.

Equation: errors as in `isc_core.evaluation.metrics.Scores`; the ratio of geometric means over the
subjects, with the interval of resampled objects: with public data, a photo and a synthetic image
may show the same one.

Citation: J. T. Barron, J. Malik (2015), doi:10.1109/TPAMI.2014.2377712; B. Efron (1979),
doi:10.1214/aos/1176344552.

Limits: it is not known how the thesis divides its figures between the tables of each pair; errors
and time are this project's choice. MIT-Berkeley-UTeM is not public; glossy-mit replaces it. With
few subjects the intervals are wide.
"""

from collections.abc import Callable, Sequence

from isc_core.evaluation.evaluate import Ratio
from isc_core.evaluation.metrics import geometric_mean

from ..measuring.context import Context
from ..measuring.framework_runs import (
    AFTER,
    BEFORE,
    BOUND,
    METRICS,
    SIRFS,
    Framework,
    FrameworkErrors,
    score_frameworks,
    subjects_with_truth,
)
from ..report import claims
from ..report.comparing import (
    format_ratio,
    judge_reduction,
    label_with_refusals,
    object_of_kind,
    paired_ratio,
)
from ..report.item import Cell, ClaimVerdict, ItemContent, ItemTable, ThesisItem

KINDS = {"specular": "photos with significant specularity", "synthetic": "synthetic images"}
_NAMES = {
    "height": "height, px",
    "normal": "normals, rad",
    "light": "light",
    "shading": "shading",
    "reflectance": "reflectance",
    "rs_mse": "RS-MSE",
    "average": "all six",
}
_CLAIMED = (
    (claims.MDR_HEIGHT, "height", 0.114),
    (claims.MDR_NORMALS, "normal", 0.065),
    (claims.MDR_LIGHT, "light", 0.505),
    (claims.MDR_SHADING, "shading", 0.352),
    (claims.MDR_REFLECTANCE, "reflectance", 0.051),
)
_JUDGED = "MDR-SIRFS"
_MODELS_AFTER, _MODELS_BEFORE = (SIRFS, *AFTER), (SIRFS, *BEFORE, BOUND)


def _errors(
    frameworks: Sequence[Framework], text: str, judged: bool
) -> Callable[[Context], ItemContent]:
    def make(context: Context) -> ItemContent:
        rows = score_frameworks(context, subjects_with_truth(context, tuple(KINDS)), frameworks)
        tables = [
            relative_error_table(_of_kind(rows, kind), words, context.seed)
            for kind, words in KINDS.items()
        ]
        tables = [
            relative_error_table(rows, "all of them", context.seed),
            *(table for table in tables if table.rows),
        ]
        verdicts = _verdicts(rows, context.seed) if judged else ()
        return ItemContent((*tables, error_table(rows)), text=text, verdicts=verdicts)

    return make


def _times(
    frameworks: Sequence[Framework], text: str, judged: bool
) -> Callable[[Context], ItemContent]:
    def make(context: Context) -> ItemContent:
        rows = score_frameworks(context, subjects_with_truth(context, tuple(KINDS)), frameworks)
        return ItemContent(
            (_speed(rows, context.seed),),
            text=text,
            verdicts=(_time_verdict(rows, context.seed),) if judged else (),
        )

    return make


def relative_error_table(rows: Sequence[FrameworkErrors], words: str, seed: int) -> ItemTable:
    """Tabulate each framework's errors relative to SIRFS.

    Parameters
    ----------
    rows : sequence of FrameworkErrors
        Errors of all runs.
    words : str
        Description of the subjects.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    ItemTable
        One row per framework, with intervals.
    """
    lines: list[tuple[str, ...]] = []
    for label in dict.fromkeys(row.framework for row in rows):
        cells = [
            format_ratio(_ratio(_of(rows, label, name), _of(rows, SIRFS.label, name), seed))
            for name in METRICS
        ]
        lines.append(
            (
                _with_refusals(rows, label),
                *(["1"] * len(METRICS) if label == SIRFS.label else cells),
            )
        )
    subjects = {row.subject for row in rows}
    objects = len({object_of_kind(subject) for subject in subjects})
    count = f"{len(subjects)} subjects"
    if objects < len(subjects):
        count += f", which show {objects} objects"
    header = ("framework", *(_NAMES[name].partition(",")[0] for name in METRICS))
    return ItemTable(
        header,
        tuple(lines),
        f"Errors relative to SIRFS, geometric means (95 %): {words}, {count}",
    )


def error_table(rows: Sequence[FrameworkErrors]) -> ItemTable:
    """Tabulate the errors of each run.

    Parameters
    ----------
    rows : sequence of FrameworkErrors
        Errors of all runs.

    Returns
    -------
    ItemTable
        One row per run.
    """
    lines: list[tuple[Cell, ...]] = [
        (row.subject, row.framework, *(row.errors[name] for name in METRICS)) for row in rows
    ]
    return ItemTable(
        ("subject", "framework", *(_NAMES[name] for name in METRICS)),
        tuple(lines),
        "Errors by subject",
    )


def _speed(rows: Sequence[FrameworkErrors], seed: int) -> ItemTable:
    lines: list[tuple[Cell, ...]] = []
    for label in dict.fromkeys(row.framework for row in rows):
        seconds, evaluations = _seconds(rows, label), _evaluations(rows, label)
        plain = label == SIRFS.label
        ratios = [
            "1" if plain else format_ratio(_ratio(ours, reference, seed))
            for ours, reference in (
                (seconds, _seconds(rows, SIRFS.label)),
                (evaluations, _evaluations(rows, SIRFS.label)),
            )
        ]
        means = [geometric_mean(each.values()) for each in (seconds, evaluations)]
        lines.append((_with_refusals(rows, label), *means, *ratios))
    header = (
        "framework",
        "seconds",
        "evaluations",
        "seconds / SIRFS (95 %)",
        "evaluations / SIRFS (95 %)",
    )
    return ItemTable(
        header,
        tuple(lines),
        "Geometric means over the subjects, after a warm-up run, two threads; "
        "evaluations of the energy",
    )


def _verdicts(rows: Sequence[FrameworkErrors], seed: int) -> tuple[ClaimVerdict, ...]:
    return tuple(
        judge_reduction(
            claim,
            share,
            _ratio(_of(rows, _JUDGED, name), _of(rows, SIRFS.label, name), seed),
            f"error of {_NAMES[name].partition(',')[0]}",
        )
        for claim, name, share in _CLAIMED
    )


def _time_verdict(rows: Sequence[FrameworkErrors], seed: int) -> ClaimVerdict:
    judged = judge_reduction(
        claims.MDR_TIME,
        0.192,
        _ratio(_seconds(rows, _JUDGED), _seconds(rows, SIRFS.label), seed),
        "time",
    )
    found = format_ratio(_ratio(_evaluations(rows, _JUDGED), _evaluations(rows, SIRFS.label), seed))
    why = f"{judged.why}; " if judged.why else ""
    return ClaimVerdict(
        judged.claim,
        judged.here,
        judged.holds,
        f"{why}evaluations, which do not depend on the load of the machine: {found} of SIRFS",
    )


def _with_refusals(rows: Sequence[FrameworkErrors], label: str) -> str:
    """Add the number of subjects that a framework refuses, which its means do not contain."""
    count = len({row.subject for row in rows})
    refused = count - len({row.subject for row in rows if row.framework == label})
    return label_with_refusals(label, refused, count)


def _ratio(ours: dict[str, float], theirs: dict[str, float], seed: int) -> Ratio | None:
    return paired_ratio(ours, theirs, seed, object_of_kind)


def _of(rows: Sequence[FrameworkErrors], label: str, name: str) -> dict[str, float]:
    return {row.subject: row.errors[name] for row in rows if row.framework == label}


def _seconds(rows: Sequence[FrameworkErrors], label: str) -> dict[str, float]:
    return {row.subject: row.seconds for row in rows if row.framework == label}


def _evaluations(rows: Sequence[FrameworkErrors], label: str) -> dict[str, float]:
    return {row.subject: float(row.evaluations) for row in rows if row.framework == label}


def _of_kind(rows: Sequence[FrameworkErrors], kind: str) -> list[FrameworkErrors]:
    return [row for row in rows if row.subject.startswith(f"{kind} ")]


_AFTER_TEXT = (
    "Below 1 is better than SIRFS on the photo. Height, normals and light of "
    "SIRFS-X are those of SIRFS, since X separates its result: only the "
    "reflectance can change, and with it the last two columns."
)
_BEFORE_TEXT = (
    "Below 1 is better than SIRFS on the photo. MZK06 and YCK06 in their improved "
    "variants, SC with both specular-free images; MDR-SIRFS with the separation "
    "`isc`. The last row is SIRFS after a perfect separation. It is no bound: errors "
    "of a separation and of SIRFS can cancel, and `joint` also uses shape and light "
    "for the separation. docs/research_log/models.md has more objects and levels of "
    "specular light, cross-validated."
)
_TIME_TEXT = "Seconds include separation and SIRFS. They depend on the load of the machine."

ITEMS: tuple[ThesisItem, ...] = (
    ThesisItem(
        "table",
        "4.19",
        "SIRFS, SIRFS-MZK06, SIRFS-YCK06, SIRFS-MBP: errors",
        _errors(_MODELS_AFTER, _AFTER_TEXT, False),
    ),
    ThesisItem(
        "table",
        "4.20",
        "SIRFS, SIRFS-MZK06, SIRFS-YCK06, SIRFS-MBP: time",
        _times(_MODELS_AFTER, _TIME_TEXT, False),
    ),
    ThesisItem(
        "table",
        "4.21",
        "SIRFS, MZK06-SIRFS, YCK06-SIRFS, MDR-SIRFS: errors",
        _errors(_MODELS_BEFORE, _BEFORE_TEXT, True),
    ),
    ThesisItem(
        "table",
        "4.22",
        "SIRFS, MZK06-SIRFS, YCK06-SIRFS, MDR-SIRFS: time",
        _times(_MODELS_BEFORE, _TIME_TEXT, True),
    ),
)
