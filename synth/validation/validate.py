"""A validation from a dataset's folder to its outcome: run, sum up, check, judge."""

from collections.abc import Sequence
from pathlib import Path

from isc_core.errors import InputError
from isc_core.progress import Monitor

from .checks.render_checks import check_dataset
from .measurement.bounds import Bound, judge
from .measurement.figures import all_figures
from .measurement.gains import all_gains
from .measurement.measure import ValidationOptions, choose_scenes, run_scenes
from .reporting.outcome import ValidationOutcome, all_budgets


def validate(
    root: Path,
    options: ValidationOptions,
    bounds: Sequence[Bound],
    renders: int,
    command: str,
    monitor: Monitor,
) -> ValidationOutcome:
    """Validates the stages on the dataset below `root`.

    `bounds` to judge by; `renders`: how many scenes to render again; `command`: what the report
    says it was made by. Raises `InputError` where the dataset cannot be read or no scene can be
    run, `Cancelled`.
    """
    folders = choose_scenes(root, options)
    checks, notes = check_dataset(folders, renders, options.seed, monitor.part(0, 0.1))
    scenes = run_scenes(folders, options, monitor.part(0.1, 1))
    measured = [scene for scene in scenes if not scene.refused]
    if not measured:
        raise InputError(f"no scene of {root} could be run: {scenes[0].refused}")
    figures = all_figures(options.stages, measured, options.seed)
    budgets = all_budgets(measured, options.seed)
    gains = all_gains(measured, options.seed)
    return ValidationOutcome(
        str(root),
        command,
        options,
        scenes,
        figures,
        budgets,
        checks,
        judge(bounds, figures),
        notes,
        gains,
    )
