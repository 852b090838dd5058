"""A run summed up: pages to look at, and tables for programs, in the inputs' order.

`summary.html` and `summary-pages/N.html`: a thumbnail of every result's sheet, which is a link to
the result, and the reasons of failures. `summary.csv`, `summary.jsonl`: the same as tables. Names
of files may be anything: they are escaped in pages, and cells of the CSV that a spreadsheet would
take for a formula get an apostrophe in front; JSON lines have them as they are.
"""

import csv
import html
import json
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from itertools import islice
from urllib.parse import quote

from ..io.atomic import new_file
from .item import FAILED
from .journal import Entry, Journal
from .run_folder import RunFolder

PAGE = 500  # images
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_COLUMNS = ("number", "name", "image", "mask", "status", "reason", "seconds", "peak_mb")
_STYLE = """body{margin:2rem;background:#141517;color:#eeeeec;font:15px/1.5 system-ui,sans-serif}a{color:inherit}
h1{font-size:1.4rem}nav a{margin-right:.8rem}.faint{color:#96999e}
main{display:grid;grid-template-columns:repeat(auto-fill,minmax(340px,1fr));gap:1rem;margin:1rem 0}
figure{margin:0;padding:.6rem;background:#212326;border-radius:8px;overflow-wrap:anywhere}
img{width:100%;border-radius:4px;display:block}.failed{border-left:4px solid #d55e00}"""


def write_summary(folder: RunFolder, journal: Journal) -> None:
    """Writes the pages and the tables of what the journal holds; each file whole or not at all."""
    with ExitStack() as stack:
        how = {"encoding": "utf-8", "errors": "backslashreplace", "newline": ""}
        table = stack.enter_context(
            stack.enter_context(new_file(folder.output / "summary.csv")).open("w", **how)
        )  # type: ignore[call-overload]
        lines = stack.enter_context(
            stack.enter_context(new_file(folder.output / "summary.jsonl")).open(
                "w", encoding="ascii"
            )
        )
        writer = csv.writer(table)
        writer.writerow(_COLUMNS)

        def passed(entries: Iterable[Entry]) -> Iterator[Entry]:
            for entry in entries:
                row = entry.row()
                writer.writerow([_cell(row[name]) for name in _COLUMNS])
                lines.write(json.dumps(row) + "\n")
                yield entry

        _write_pages(folder, journal, passed(journal.entries()))


def _cell(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def _write_pages(folder: RunFolder, journal: Journal, entries: Iterator[Entry]) -> None:
    count = max(1, -(-sum(journal.counts.values()) // PAGE))
    for page in range(1, count + 1):
        target = folder.output / "summary.html" if page == 1 else folder.pages / f"{page}.html"
        base = "" if page == 1 else "../"
        text = _page(journal, list(islice(entries, PAGE)), page, count, base)
        with new_file(target) as partial:
            partial.write_text(text, encoding="utf-8", errors="backslashreplace")
    for _ in entries:  # none is left; the tables have seen all of them only now
        raise AssertionError("the journal holds more images than it counts")


def _page(journal: Journal, entries: list[Entry], page: int, count: int, base: str) -> str:
    reached = sum(journal.counts.values())
    told = ", ".join(f"{journal.counts[status]} {status}" for status in ("done", "skipped", FAILED))
    missing = f", {journal.total - reached} not reached" if reached < journal.total else ""
    links = _links(page, count, base)
    tables = "".join(
        f'<a href="{base}{name}">{name}</a>'
        for name in ("failures.jsonl", "summary.csv", "summary.jsonl")
    )
    return "\n".join(
        [
            '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">',
            "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src 'self'; style-src 'unsafe-inline'\">",
            f"<title>ISC batch</title><style>{_STYLE}</style>",
            f'<h1>{journal.total} images: {told}{missing}</h1><nav class="faint">{tables}</nav><nav>{links}</nav>',
            "<main>",
            *(_card(entry, base) for entry in entries),
            f"</main><nav>{links}</nav></html>\n",
        ]
    )


def _links(page: int, count: int, base: str) -> str:
    """To the pages near this one, and the first and last."""
    near = sorted({1, count, *range(max(1, page - 3), min(count, page + 3) + 1)})
    if count == 1:
        return ""
    place = {
        number: f"{base}summary.html" if number == 1 else f"{base}summary-pages/{number}.html"
        for number in near
    }
    return "".join(
        f"<b>{number}</b> " if number == page else f'<a href="{place[number]}">{number}</a>'
        for number in near
    )


def _card(entry: Entry, base: str) -> str:
    outcome, image = entry.outcome, html.escape(entry.image)
    if outcome.status == FAILED or not entry.name:
        kind = ' class="failed"' if outcome.status == FAILED else ""
        return f"<figure{kind}><figcaption>{image}<br><b>{outcome.status}</b> {html.escape(outcome.reason)}</figcaption></figure>"
    name = quote(entry.name)
    return (
        f'<figure><a href="{base}{name}/preview.png"><img loading="lazy" alt="" src="{base}thumbnails/{name}.jpg"></a>'
        f'<figcaption>{html.escape(entry.name)} <span class="faint">{image}, {outcome.status}, {outcome.seconds:.1f} s</span>'
        "</figcaption></figure>"
    )
