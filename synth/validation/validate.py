"""A validation, from a data set's folder to its outcome: run, summarise and check."""

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
    """Validate the stages on a data set.

    Parameters
    ----------
    root : Path
        Folder of a data set that `isc synth` wrote.
    options : ValidationOptions
        Stages and settings.
    bounds : sequence of Bound
        Regression bounds.
    renders : int
        Number of scenes to render again as a check.
    command : str
        The command that repeats the run, for the report.
    monitor : Monitor
        Progress and cancellation.

    Returns
    -------
    ValidationOutcome
        The result.

    Raises
    ------
    InputError
        If the data set cannot be read or no scene can be run.
    Cancelled
        If the user cancels.
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
