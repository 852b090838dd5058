"""Several photos, or several objects in one: failures do not stop the others."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from ...errors import InputError, Rejected
from ...io.memory import memory_message
from ...progress import Monitor, ProgressEvent

Work = Callable[[Monitor], list[str]]


def problem_of(error: InputError | MemoryError | OSError) -> str:
    """Return the message for an error caused by the input or the machine.

    Parameters
    ----------
    error : InputError, MemoryError or OSError

    Returns
    -------
    str
        One line.
    """
    if isinstance(error, MemoryError):
        return memory_message(error, "use a smaller image or a smaller --max-size")
    if isinstance(error, OSError):
        location = f"{error.filename}: " if error.filename else ""
        return str(InputError(f"{location}{error.strerror or error}"))
    return str(error)


def do_all(kind: str, works: Mapping[str, Work], monitor: Monitor) -> list[str]:
    """Do several jobs one after the other, regardless of failures.

    Parameters
    ----------
    kind : str
        The kind of job, in the plural.
    works : mapping of str to callable
        By name, which becomes the prefix of stages and failures; each returns lines to print.
    monitor : Monitor
        Each job has an equal part of it.

    Returns
    -------
    list of str
        Lines to print.

    Raises
    ------
    Rejected
        At the end, if some failed: a line for each.
    """
    lines, failures = list[str](), list[str]()
    for index, (name, work) in enumerate(works.items()):
        part = monitor.part(index / len(works), (index + 1) / len(works))
        try:
            lines += work(_named(part, name, (index + 1, len(works))))
        except BrokenPipeError:  # the reader of the reports has ended
            raise
        except (InputError, MemoryError, OSError) as error:
            problem = problem_of(error)
            failures.append(problem if name in problem else f"{name}: {problem}")
    if failures:
        done = f"{len(failures)} of {len(works)} {kind} failed"
        raise Rejected("\n".join([*failures, done]), lines)
    return lines


def _named(monitor: Monitor, name: str, part: tuple[int, int]) -> Monitor:
    """A monitor that adds a name as the prefix of stages."""

    def report(event: ProgressEvent) -> None:
        monitor.progress(replace(event, stage=f"{name}: {event.stage}", part=part))

    return Monitor(report, monitor.cancelled)
