"""The summary of a run: HTML pages, and tables for programs, in input order.

`summary.html` and `summary-pages/N.html`: a thumbnail of every result, linked to the result, and
the reasons of failures. `summary.csv`, `summary.jsonl`: the same as tables. File names may contain
any characters: pages escape them, and CSV cells that a spreadsheet would interpret as a formula are
prefixed with an apostrophe; JSON lines keep them unchanged.
"""

import csv
import json
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from itertools import islice
from typing import Any

from ..io.atomic import new_file
from .journal import Journal, JournalEntry
from .run_folder import RunFolder, thumbnail_place

PAGE = 500  # results
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_COLUMNS = ("number", "name", "image", "mask", "status", "reason", "seconds", "peak_mb")


def write_summary(folder: RunFolder, journal: Journal) -> None:
    """Write the pages and tables of a journal, each file completely or not at all.

    Parameters
    ----------
    folder : RunFolder
    journal : Journal
    """
    with ExitStack() as stack:
        table = stack.enter_context(
            stack.enter_context(new_file(folder.output / "summary.csv")).open(
                "w", encoding="utf-8", errors="backslashreplace", newline=""
            )
        )
        lines = stack.enter_context(
            stack.enter_context(new_file(folder.output / "summary.jsonl")).open(
                "w", encoding="ascii"
            )
        )
        writer = csv.writer(table)
        writer.writerow(_COLUMNS)

        def recorded(entries: Iterable[JournalEntry]) -> Iterator[JournalEntry]:
            for entry in entries:
                row = entry.row()
                writer.writerow([_cell(row[name]) for name in _COLUMNS])
                lines.write(json.dumps(row) + "\n")
                yield entry

        _write_pages(folder, journal, recorded(journal.entries()))


def _cell(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def _write_pages(folder: RunFolder, journal: Journal, entries: Iterator[JournalEntry]) -> None:
    count = max(1, -(-sum(journal.counts.values()) // PAGE))
    # Imported here: an optional dependency of the extra `batch`, which Dask needs, too.
    import jinja2

    loader = jinja2.PackageLoader(__package__, "templates")
    template = jinja2.Environment(loader=loader, autoescape=True).get_template("summary.html")
    for page in range(1, count + 1):
        target = folder.output / "summary.html" if page == 1 else folder.pages / f"{page}.html"
        text = _page(template, journal, list(islice(entries, PAGE)), page, count)
        with new_file(target) as partial:
            partial.write_text(text, encoding="utf-8", errors="backslashreplace")
    for _ in entries:  # exhausts the generator, so that the tables are complete
        raise AssertionError("the journal has more images than it counts")


def _page(
    template: Any, journal: Journal, entries: list[JournalEntry], page: int, count: int
) -> str:
    near = {1, count, *range(max(1, page - 3), min(count, page + 3) + 1)}
    return str(
        template.render(
            total=journal.total,
            reached=sum(journal.counts.values()),
            counts=journal.counts,
            entries=entries,
            page=page,
            links=sorted(near) if count > 1 else [],
            base="" if page == 1 else "../",
            thumbnail=thumbnail_place,
        )
    )
