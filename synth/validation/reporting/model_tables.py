"""Tables of the stage "models": one row per model, one column per error, relative to plain SIRFS,
for all scenes and for each slice.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..measurement.figures import Figure
from ..measurement.gains import LEAST, Gain
from ..measurement.slices import EVERYTHING, Slice
from ..stages.models import ERRORS, NAME, PLAIN, TITLES, TRUE_DIFFUSE, metric_name
from .formatting import percent, with_interval
from .outcome import ValidationOutcome
from .tables import TextTable

EXPLANATION = (
    "Every model decomposes the same photos as isc decompose would. For comparison, SIRFS runs on "
    "the unmodified photo (plain) and on the true diffuse layer. The figures are geometric means "
    "over scenes of a model's error divided by that of plain SIRFS on the same scene: below 1 is "
    "better. Percentages are the share of the gain that the true diffuse layer achieves, shown "
    f"where that gain is at least {100 * LEAST:.0f} %. The first row has the absolute errors of "
    "plain SIRFS. SIRFS solves with the object 256 pixels long, so these figures do not compare "
    "with the errors of other stages."
)

_Key = tuple[str, str, str]  # kind and value of a slice, name of a metric


@dataclass(frozen=True)
class ModelTable:
    """The models over one kind of slice.

    Attributes
    ----------
    kind : str
        Kind of the slices, "all" for all scenes.
    table : TextTable
        Slice and number of scenes (except for "all"), model, and the `ERRORS`.
    """

    kind: str
    table: TextTable


def model_tables(outcome: ValidationOutcome) -> tuple[ModelTable, ...]:
    """Tabulate the models, all scenes first, then each kind of slice.

    Parameters
    ----------
    outcome : ValidationOutcome
        The validation.

    Returns
    -------
    tuple of ModelTable
        Empty if the stage was not run.
    """
    figures = {
        (f.group.kind, f.group.value, f.metric.name): f for f in outcome.figures if f.stage == NAME
    }
    gains = {(g.group.kind, g.group.value, metric_name(g.model, g.error)): g for g in outcome.gains}
    groups = {(f.group.kind, f.group.value): f.group for f in figures.values()}
    titles = tuple(error.title for error in ERRORS)
    tables = []
    for kind in dict.fromkeys(group.kind for group in groups.values()):
        whole = kind == EVERYTHING
        rows = tuple(
            (
                *(() if whole else (group.value, str(len(group.members)))),
                TITLES[variant],
                *_cells(variant, group, figures, gains),
            )
            for group in groups.values()
            if group.kind == kind
            for variant in _variants(figures, whole)
        )
        heading = (*(() if whole else (kind, "scenes")), "model", *titles)
        tables.append(ModelTable(kind, TextTable(heading, rows, heading.index("model") + 1)))
    return tuple(tables)


def model_findings(outcome: ValidationOutcome) -> tuple[str, ...]:
    """Return one sentence per model: its average error relative to plain SIRFS.

    Parameters
    ----------
    outcome : ValidationOutcome
        The validation.

    Returns
    -------
    tuple of str
        Plain text.
    """
    first = ERRORS[0]
    shares = {
        g.model: g.share
        for g in outcome.gains
        if g.group.kind == EVERYTHING and g.error == first.name
    }
    found = []
    for figure in (f for f in outcome.figures if f.stage == NAME and f.group.kind == EVERYTHING):
        variant, error = figure.metric.name.split(".")
        if error != first.name or variant == PLAIN:
            continue
        ratio = with_interval(figure.interval)
        sentence = f"{TITLES[variant]}: {ratio} of the {first.title} of plain SIRFS"
        if variant in shares:
            sentence += f", {percent(shares[variant])} of the gain of the true diffuse layer"
        found.append(f"{sentence} ({figure.interval.scenes} scenes).")
    return tuple(found)


def _variants(figures: Mapping[_Key, Figure], whole: bool) -> Sequence[str]:
    """Rows in order: plain SIRFS (for all scenes only), the models, the true diffuse layer."""
    measured = dict.fromkeys(name.split(".")[0] for _, _, name in figures)
    models = [name for name in measured if name not in (PLAIN, TRUE_DIFFUSE)]
    return (*((PLAIN,) if whole else ()), *models, TRUE_DIFFUSE)


def _cells(
    variant: str, group: Slice, figures: Mapping[_Key, Figure], gains: Mapping[_Key, Gain]
) -> tuple[str, ...]:
    keys = [(group.kind, group.value, metric_name(variant, error.name)) for error in ERRORS]
    shares = [f"; {percent(gains[key].share)}" if key in gains else "" for key in keys]
    return tuple(
        with_interval(figures[key].interval) + share
        for key, share in zip(keys, shares, strict=True)
    )
