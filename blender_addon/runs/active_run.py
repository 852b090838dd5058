"""The active run: at most one worker runs per process, whichever window or file has started it."""

from typing import Any

from isc_core.errors import InputError

from .messages import busy_message
from .worker_run import WorkerRun

_active: list[WorkerRun] = []


def active_run() -> WorkerRun | None:
    """Return the active run, or None."""
    return next((run for run in _active if not run.ended), None)


def begin_run(run: WorkerRun) -> WorkerRun:
    """Make a run the active one.

    Parameters
    ----------
    run : WorkerRun
        The new run; cancelled if there is an active one.

    Returns
    -------
    WorkerRun
        The same run.

    Raises
    ------
    InputError
        If another run is active.
    """
    present = active_run()
    if present is not None:
        run.cancel()
        raise InputError(busy_message(present.title))
    _active[:] = [run]
    return run


def poll_idle(operator: Any) -> bool:
    """Return whether no run is active; else the tooltip names it.

    Parameters
    ----------
    operator : type
        Of the button.

    Returns
    -------
    bool
    """
    present = active_run()
    if present is not None:
        operator.poll_message_set(busy_message(present.title))
    return present is None


def require_no_active_run() -> None:
    """Check that no run is active.

    Raises
    ------
    InputError
        If a run is active.
    """
    present = active_run()
    if present is not None:
        raise InputError(busy_message(present.title))


def cancel_active_run() -> None:
    """Cancel the active run, if any: Blender exits, or another file is loaded."""
    present = active_run()
    if present is not None:
        present.cancel()
