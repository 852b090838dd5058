"""Make items one after another: complete ones are kept, failures are listed at the end.

Equation: time left = time so far * (1 - f) / f, with f the share of the items' expected seconds:
those of their records, or else the records' median.
"""

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from isc_core.errors import InputError
from isc_core.io.atomic import require_writable_file
from isc_core.progress import Monitor, ProgressEvent

from .measuring.context import Context
from .registry import all_items
from .report.files import write_index, write_item
from .report.item import ThesisItem
from .report.records import ItemRecord, is_complete, read_record, read_records

_DEFAULT_SECONDS = 10.0  # of an item without a record


@dataclass(frozen=True)
class MakeSummary:
    """Result of `make_items`.

    Attributes
    ----------
    made, kept : int
        Number of items made, and of those that were complete already.
    failed : tuple of (str, str)
        Items that failed, each with a reason of one line.
    """

    made: int
    kept: int
    failed: tuple[tuple[str, str], ...]


def make_items(
    wanted: Sequence[ThesisItem], context: Context, *, again: bool = False
) -> MakeSummary:
    """Make items and the index.

    Parameters
    ----------
    wanted : sequence of ThesisItem
        The items.
    context : Context
        The run.
    again : bool
        Make complete items again.

    Returns
    -------
    MakeSummary
        What was made, kept and failed.

    Raises
    ------
    InputError
        If data or folder cannot be used, or if a single item was wanted and fails.
    Cancelled
        If the user cancels.
    """
    context.check()
    require_writable_file(context.output / "README.md")
    missing = [
        item
        for item in wanted
        if again or not is_complete(context.output, item.name, context.fingerprint)
    ]
    if not missing:
        write_index(context.output, all_items())
    failed: list[tuple[str, str]] = []
    for item, part in _with_monitors(missing, context):
        try:
            _make(item, replace(context, monitor=part))
        except InputError as error:
            if len(wanted) == 1:
                raise
            failed.append((f"{item.kind} {item.number}", str(error)))
        else:
            # After each item, so that the index of an interrupted run is up to date.
            write_index(context.output, all_items())
    return MakeSummary(len(missing) - len(failed), len(wanted) - len(missing), tuple(failed))


def item_states(items: Sequence[ThesisItem], folder: Path) -> Iterator[str]:
    """Describe each item: number, state, title and verdicts.

    Parameters
    ----------
    items : sequence of ThesisItem
        The items.
    folder : Path
        Output folder with records.

    Yields
    ------
    str
        One line per item, followed by one per verdict.
    """
    records = read_records(folder, items)
    for item in items:
        record = records.get(item.name)
        reason = f" ({item.reason})" if item.make is None else ""
        yield f"{item.kind:6s} {item.number:5s} {_state(item, record):15s} {item.title}{reason}"
        for verdict in record.verdicts if record is not None else ():
            yield f"    {verdict.holds}: {verdict.claim}"


def _state(item: ThesisItem, record: ItemRecord | None) -> str:
    if item.make is None:
        return "not regenerable"
    return "made" if record is not None else "not made"


def _make(item: ThesisItem, context: Context) -> None:
    assert item.make is not None
    begin = time.monotonic()
    write_item(item, item.make(context), context, time.monotonic() - begin)


def _with_monitors(
    missing: Sequence[ThesisItem], context: Context
) -> Iterator[tuple[ThesisItem, Monitor]]:
    """Yield the items, each with the monitor of its part of the whole."""
    known = {
        item.name: record.seconds
        for item in missing
        if (record := read_record(context.output, item.name)) is not None
    }
    default = statistics.median(known.values()) if known else _DEFAULT_SECONDS
    costs = [max(known.get(item.name, default), 0.1) for item in missing]
    begin, done, total = time.monotonic(), 0.0, sum(costs)
    for number, (item, cost) in enumerate(zip(missing, costs, strict=True)):
        name = f"{item.kind} {item.number} ({number + 1} of {len(missing)})"
        part = Monitor(
            _named_progress(name, context.monitor, begin, done / total, (done + cost) / total),
            context.monitor.cancelled,
        )
        part.report("", 0.0)
        yield item, part
        done += cost


def _named_progress(
    name: str, monitor: Monitor, begin: float, start: float, end: float
) -> Callable[[ProgressEvent], None]:
    """Progress inside an item: its name, the stage and the time left."""

    def progress(event: ProgressEvent) -> None:
        whole = start + (end - start) * min(max(event.fraction, 0.0), 1.0)
        left = _time_left((time.monotonic() - begin) * (1 - whole) / whole) if whole > 0.01 else ""
        text = f"{name}: {event.stage}" if event.stage else name
        monitor.progress(ProgressEvent(text, whole, left))

    return progress


def _time_left(seconds: float) -> str:
    """Format as in "3 min left"."""
    if seconds < 90:
        return f"{seconds:.0f} s left"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min left"
    return f"{seconds / 3600:.1f} h left"
