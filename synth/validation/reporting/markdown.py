"""The summary of a validation as Markdown: findings, error budget and one table per stage."""

from ...templating import render
from ..stages.models import NAME as MODELS
from ..stages.models import TITLE as MODELS_TITLE
from .findings import figures_by_stage, findings, stage_title, verdict_line
from .model_tables import EXPLANATION, model_tables
from .outcome import ValidationOutcome
from .tables import budget_table, stage_table

# Slices of models in the summary; the report has all.
MODEL_SLICES = ("all", "material", "gloss", "albedo", "light")


def summary(outcome: ValidationOutcome) -> str:
    """Write the summary.

    Parameters
    ----------
    outcome : ValidationOutcome
        The validation.

    Returns
    -------
    str
        Markdown.

    Raises
    ------
    InputError
        If Jinja2 is not installed.
    """
    stages = figures_by_stage(outcome.figures)
    models = {found.kind: found.table for found in model_tables(outcome)}
    return render(
        __file__,
        "summary.md.j2",
        outcome=outcome,
        verdict=verdict_line(outcome),
        findings=findings(outcome),
        budget=budget_table(outcome.budgets) if outcome.budgets else None,
        stages=[
            (stage_title(stage), stage_table(figures))
            for stage, figures in stages.items()
            if stage != MODELS
        ],
        models=[(kind, models[kind]) for kind in MODEL_SLICES if kind in models],
        models_title=MODELS_TITLE,
        explanation=EXPLANATION,
    )
