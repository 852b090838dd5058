"""Making items one after the other: what is complete is kept, what fails is named at the end, and a
person sees how long it takes.

Equation: time left = time so far * (1 - f) / f, f the share of the items' expected seconds: those
that a record names, else their median.
"""

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from isc_core.errors import InputError
from isc_core.io.atomic import require_writable_file
from isc_core.progress import Monitor

from .measuring.context import Context
from .registry import all_items as all_items
from .report.item import ThesisItem
from .report.written import is_complete, read_record, write_index, write_item

_USUAL = 10.0  # seconds of an item that nobody has timed


@dataclass(frozen=True)
class MakeSummary:
    """How many items were `made` and how many `kept`; which `failed`, with the reason in one line."""

    made: int
    kept: int
    failed: tuple[tuple[str, str], ...]


def make_items(
    wanted: Sequence[ThesisItem], context: Context, *, again: bool = False
) -> MakeSummary:
    """Makes the items that are not complete, or all of them `again`, and the index.

    Raises `InputError` where data or folder cannot be used, or where a single item was wanted and
    fails; `Cancelled`.
    """
    context.check()
    require_writable_file(context.output / "README.md")
    missing = [
        item
        for item in wanted
        if again or not is_complete(context.output, item.name, context.fingerprint)
    ]
    failed: list[tuple[str, str]] = []
    for item, part in _watched(missing, context):
        try:
            _make(item, replace(context, monitor=part))
        except InputError as error:
            if len(wanted) == 1:
                raise
            failed.append((f"{item.kind} {item.number}", str(error)))
        else:
            # After each item, so that the index of a long run, or an interrupted one, is never
            # behind.
            write_index(context.output, all_items())
    return MakeSummary(len(missing) - len(failed), len(wanted) - len(missing), tuple(failed))


def item_states(all_items: Sequence[ThesisItem], folder: Path) -> Iterator[str]:
    """A line for each item: what it is, whether it is made, and which claims it has a verdict on."""
    for item in all_items:
        record = read_record(folder, item.name)
        state = (
            "not regenerable" if item.make is None else "made" if record is not None else "not made"
        )
        said = (
            "".join(f"\n    {verdict.holds}: {verdict.claim}" for verdict in record.verdicts)
            if record is not None
            else ""
        )
        reason = f" ({item.reason})" if item.make is None else ""
        yield f"{item.kind:6s} {item.number:5s} {state:15s} {item.title}{reason}{said}"


def _make(item: ThesisItem, context: Context) -> None:
    assert item.make is not None
    begin = time.monotonic()
    write_item(item, item.make(context), context, time.monotonic() - begin)


def _watched(
    missing: Sequence[ThesisItem], context: Context
) -> Iterator[tuple[ThesisItem, Monitor]]:
    """The items, each with the monitor of its part of the whole."""
    known = {
        item.name: record.seconds
        for item in missing
        if (record := read_record(context.output, item.name)) is not None
    }
    usual = statistics.median(known.values()) if known else _USUAL
    costs = [max(known.get(item.name, usual), 0.1) for item in missing]
    begin, done, total = time.monotonic(), 0.0, sum(costs)
    for number, (item, cost) in enumerate(zip(missing, costs, strict=True)):
        name = f"{item.kind} {item.number} ({number + 1} of {len(missing)})"
        part = Monitor(
            _speaking(name, context.monitor, begin, done / total, (done + cost) / total),
            context.monitor.cancelled,
        )
        part.report("", 0.0)
        yield item, part
        done += cost


def _speaking(
    name: str, monitor: Monitor, begin: float, start: float, end: float
) -> Callable[[str, float], None]:
    """Progress inside an item, with the item's name before the stage and the time left behind it."""

    def progress(stage: str, fraction: float) -> None:
        whole = start + (end - start) * min(max(fraction, 0.0), 1.0)
        left = _in_words((time.monotonic() - begin) * (1 - whole) / whole) if whole > 0.01 else ""
        monitor.progress(f"{name}{f': {stage}' if stage else ''}{left}", whole)

    return progress


def _in_words(seconds: float) -> str:
    """ ", 3 min left"."""
    return (
        f", {seconds:.0f} s left"
        if seconds < 90
        else f", {seconds / 60:.0f} min left"
        if seconds < 5400
        else f", {seconds / 3600:.1f} h left"
    )
