"""The stage "models" as tables: a row a model, a column an error, relative to plain SIRFS, for all
scenes and for each slice.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ..measurement.figures import Figure
from ..measurement.gains import LEAST, Gain
from ..measurement.slices import EVERYTHING, Slice
from ..stages.models import ERRORS, NAME, PLAIN, TITLES, TRUE_DIFFUSE, metric_name
from .outcome import ValidationOutcome
from .words import percent, with_interval

EXPLANATION = (
    "Every model explains the same photos as isc decompose would, with SIRFS on the photo as it is (plain) and on the true diffuse layer "
    "beside it. Figures are geometric means over scenes of a model's error over plain SIRFS' on the same scene: below 1 is better; in "
    f"per cent, the share of what the true diffuse layer gains, where it gains {100 * LEAST:.0f} % or more. The first row has plain SIRFS' "
    "own errors. SIRFS is solved with the object 256 pixels long, so these do not compare with the errors of other stages."
)


@dataclass(frozen=True)
class ModelTable:
    """`kind` of slices, "all" for all scenes.

    Cells: the slice and its number of scenes (not for "all"), the model, the `ERRORS`.
    """

    kind: str
    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def model_tables(outcome: ValidationOutcome) -> tuple[ModelTable, ...]:
    """All scenes first, then each kind of slices; none where the stage was not run."""
    figures = {
        (f.group.kind, f.group.value, f.metric.name): f for f in outcome.figures if f.stage == NAME
    }
    gains = {(g.group.kind, g.group.value, metric_name(g.model, g.error)): g for g in outcome.gains}
    groups = {(f.group.kind, f.group.value): f.group for f in figures.values()}
    titles = tuple(error.title for error in ERRORS)
    tables = []
    for kind in dict.fromkeys(group.kind for group in groups.values()):
        found, whole = (
            [group for group in groups.values() if group.kind == kind],
            kind == EVERYTHING,
        )
        rows = [
            (
                *(() if whole else (group.value, str(len(group.members)))),
                TITLES[variant],
                *_cells(variant, group, figures, gains),
            )
            for group in found
            for variant in _variants(figures, whole)
        ]
        tables.append(
            ModelTable(kind, (*(() if whole else (kind, "scenes")), "model", *titles), tuple(rows))
        )
    return tuple(tables)


def model_findings(outcome: ValidationOutcome) -> tuple[str, ...]:
    """A sentence a model: its avg beside plain SIRFS' and the share of the true diffuse layer's
    gain.
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
        if error == first.name and variant != PLAIN:
            share = (
                f", {percent(shares[variant])} of what the true diffuse layer gains"
                if variant in shares
                else ""
            )
            over = f"over {figure.interval.scenes} scenes"
            found.append(
                f"{TITLES[variant]} has {with_interval(figure.interval)} of plain SIRFS' {first.title} {over}{share}."
            )
    return tuple(found)


def _variants(figures: dict[tuple[str, str, str], Figure], whole: bool) -> Sequence[str]:
    """In the order of the rows: plain SIRFS, only for all scenes, the models, the true diffuse
    layer.
    """
    measured = dict.fromkeys(name.split(".")[0] for _, _, name in figures)
    models = [name for name in measured if name not in (PLAIN, TRUE_DIFFUSE)]
    return (*((PLAIN,) if whole else ()), *models, TRUE_DIFFUSE)


def _cells(
    variant: str,
    group: Slice,
    figures: dict[tuple[str, str, str], Figure],
    gains: dict[tuple[str, str, str], Gain],
) -> tuple[str, ...]:
    keys = [(group.kind, group.value, metric_name(variant, error.name)) for error in ERRORS]
    shares = [f"; {percent(gains[key].share)}" if key in gains else "" for key in keys]
    return tuple(
        with_interval(figures[key].interval) + share
        for key, share in zip(keys, shares, strict=True)
    )
