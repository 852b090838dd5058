"""The report as one HTML page that opens without a network: style, chart and pictures are inline,
and it runs no script. All text from outside (names of scenes, options, messages) is escaped.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ...templating import render
from ..measurement.figures import CHAIN
from ..measurement.slices import EVERYTHING
from ..stages.models import NAME as MODELS
from ..stages.pictures import png_data
from .budget_chart import budget_chart
from .cases import ValidationCase
from .findings import CHAIN_TITLE, figures_by_stage, findings, verdict_line
from .model_tables import EXPLANATION, model_tables
from .outcome import ValidationOutcome, versions
from .tables import TextTable, budget_table, slice_tables, stage_table, verdict_table


@dataclass(frozen=True)
class _Section:
    """One stage of the page; `folded` tables are titled and closed at first."""

    title: str
    explanation: str
    table: TextTable
    folded: tuple[tuple[str, TextTable], ...]
    cases: tuple[ValidationCase, ...]


def page(
    outcome: ValidationOutcome, cases: Sequence[ValidationCase], evidence: Sequence[str]
) -> str:
    """Write the report as an HTML page.

    Parameters
    ----------
    outcome : ValidationOutcome
        The validation.
    cases : sequence of ValidationCase
        Best, median and worst scenes with their pictures.
    evidence : sequence of str
        Files with maps of rejected scenes, relative to the page.

    Returns
    -------
    str
        The page.

    Raises
    ------
    InputError
        If Jinja2 is not installed.
    """
    stages = sorted(figures_by_stage(outcome.figures), key=lambda stage: stage != CHAIN)
    return render(
        __file__,
        "report.html.j2",
        outcome=outcome,
        verdict=verdict_line(outcome),
        findings=findings(outcome),
        budget=budget_table(outcome.budgets, details=True) if outcome.budgets else None,
        chart=budget_chart(outcome.budgets) if outcome.budgets else None,
        sections=[_section(stage, outcome, cases) for stage in stages],
        verdicts=verdict_table(outcome.verdicts, outcome.checks),
        evidence=evidence,
        settings=_settings(outcome),
        png_data=png_data,
    )


def _section(stage: str, outcome: ValidationOutcome, cases: Sequence[ValidationCase]) -> _Section:
    own = tuple(case for case in cases if case.stage == stage)
    if stage == MODELS:
        tables = {found.kind: found.table for found in model_tables(outcome)}
        whole = tables.pop(EVERYTHING)
        return _Section(_title(stage, outcome), EXPLANATION, whole, tuple(tables.items()), own)
    figures = [f for f in outcome.figures if f.stage == stage]
    table = stage_table(figures, details=True)
    return _Section(_title(stage, outcome), "", table, slice_tables(figures), own)


def _title(stage: str, outcome: ValidationOutcome) -> str:
    if stage == CHAIN:
        return CHAIN_TITLE
    return next(found.title for found in outcome.options.stages if found.name == stage)


def _settings(outcome: ValidationOutcome) -> str:
    options = outcome.options
    facts = [
        f"separator {options.settings.separator}",
        f"illumination {options.settings.illumination}",
        f"seed {options.seed}",
    ]
    facts += [f"{name} {version}" for name, version in versions().items()]
    return ", ".join(facts)
