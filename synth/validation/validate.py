"""A validation from a dataset's folder to its outcome: run, sum up, check, judge."""

from collections.abc import Sequence
from pathlib import Path

from isc_core.errors import InputError
from isc_core.progress import Monitor

from .bounds import Bound, judge
from .figures import all_figures
from .gains import all_gains
from .outcome import Outcome, all_budgets
from .render_checks import check_dataset
from .run import RunOptions, choose_scenes, run_scenes


def validate(
    root: Path,
    options: RunOptions,
    bounds: Sequence[Bound],
    renders: int,
    command: str,
    monitor: Monitor,
) -> Outcome:
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
    return Outcome(
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
