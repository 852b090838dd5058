"""Markdown of items and of the index."""

from collections import Counter
from collections.abc import Mapping, Sequence

from .claims import ABSTRACT
from .item import ClaimVerdict, Holds, ItemContent, ItemTable, ThesisItem
from .records import ItemRecord

FILES = "Files: "  # first word of the paragraph that lists an item's files
_INTRODUCTION = """\
The tables and figures of H. Akbar, *3D Intrinsic Scene Characteristics Extraction Framework for a
Single Image* (thesis, 2016), regenerated on open data.

The thesis measures on MIT-Berkeley-UTeM, a data set with rendered highlights that is not public.
`isc synth glossy-mit` replaces it: objects of MIT-Berkeley, or this project's own where no copy is
given, with specular light of known strength. Numbers therefore differ from those of the thesis;
what can be compared is which method is better, and by how much.
"""
_REGENERATE = """\
## Regenerate

```
isc thesis all -o results                 # everything, on images rendered by the project
isc thesis all --data ROOT -o results     # the same on public data sets
isc thesis table 4.5 -o results           # one table
isc thesis figure 4.50 -o results         # one figure
```

`-o` names the output folder: Markdown, CSV and PNG files of every item, a picture sheet per
chapter, and this index. `isc thesis publish -o results --to docs/thesis` copies the index, the
pages of the tables and the sheets here; all other files stay in the output folder. `--quick` takes
minutes instead of hours.
"""
_SHORT_NAMES = (
    (
        "PSO, ClonalG, CS",
        "threshold searches: a particle swarm, clonal selection, and clonal selection with chaotic "
        "numbers",
    ),
    ("CS of layers", "Chaotic Segmentation: highlights found by such thresholds and inpainted"),
    (
        "SC",
        "Sparse Coding of specular-free images: SF1, with a constant chromaticity; SF2, two-band",
    ),
    (
        "MZK06, YCK06, YWA10, SC09",
        "separations by Mallick et al., Yoon et al. (both 2006), Yang et al. (2010), Shen & Cai "
        "(2009)",
    ),
    ("iterative, ISC", "the separation by Tan & Ikeuchi (2005), and `isc`, this project's own"),
    (
        "as published, improved",
        "a method as its authors describe it, and with this project's changes",
    ),
    ("doing nothing", "the photo itself as the diffuse layer; a method must beat it to be useful"),
    ("SIRFS", "shape, light and reflectance from the shading of one image (Barron & Malik 2015)"),
    ("X-SIRFS, MDR-SIRFS", "SIRFS on the diffuse layer of the separation X, or of `isc`"),
    (
        "SIRFS-X, SIRFS-MBP",
        "SIRFS on the photo, then separation of its reflectance by X, or by `isc`",
    ),
    ("joint", "MDR-SIRFS, whose shape and light then improve the separation"),
    ("MSE, RMS", "mean square error, and root mean square"),
    (
        "LMSE",
        "local error in small windows, each at its best scale; 0 is perfect, 1 is an empty layer",
    ),
    ("RS-MSE", "mean of the local errors of reflectance and shading"),
    ("a / b (95 %)", "ratio of geometric means, with its 95 % interval"),
    ("K", "number of thresholds"),
)


def item_page(
    item: ThesisItem,
    content: ItemContent,
    record: ItemRecord,
    pictures: Sequence[str],
    lists: Sequence[str],
) -> str:
    """Build the page of an item.

    Parameters
    ----------
    item : ThesisItem
        The item.
    content : ItemContent
        Its content.
    record : ItemRecord
        How it was made.
    pictures, lists : sequence of str
        Names of its PNG and CSV files.

    Returns
    -------
    str
        Markdown.
    """
    title = f"{item.kind.capitalize()} {item.number}: {item.title}"
    parts = [f"# {title}", *(verdict_line(verdict) for verdict in content.verdicts)]
    if not content.verdicts:
        parts.append("The thesis' abstract makes no claim about this.")
    parts += [f"![{title}]({picture})" for picture in pictures if content.figures]
    for table in content.tables:
        parts += (
            [table.caption, markdown_table(table)] if table.caption else [markdown_table(table)]
        )
    if content.text:
        parts.append(content.text.strip())
    parts.append(
        f"Made by `{record.command}` (seed {record.seed}, ISC {record.version}, {record.machine}, "
        f"{record.seconds:g} s). [The index](README.md#short-names) explains short names."
    )
    files = (*lists, *(pictures if not content.figures else ()))
    if files:
        parts.append(FILES + ", ".join(f"[{file}]({file})" for file in files) + ".")
    return "\n\n".join(parts) + "\n"


def without_files(page: str) -> str:
    """Remove the pictures and the list of files from a page, for a folder without them.

    Parameters
    ----------
    page : str
        Markdown.

    Returns
    -------
    str
        Markdown.
    """
    parts = page.rstrip("\n").split("\n\n")
    return "\n\n".join(part for part in parts if not part.startswith(("![", FILES))) + "\n"


def markdown_table(table: ItemTable) -> str:
    """Format a table in Markdown.

    Parameters
    ----------
    table : ItemTable

    Returns
    -------
    str
        Numbers have four digits.
    """
    rows = [[cell.replace("|", "\\|") for cell in row] for row in shown_cells(table)]
    rule = "|" + "---|" * len(table.header)
    lines = ["| " + " | ".join(row) + " |" for row in (table.header, *rows)]
    return "\n".join([lines[0], rule, *lines[1:]])


def shown_cells(table: ItemTable) -> list[list[str]]:
    """Return the rows of a table as text.

    Parameters
    ----------
    table : ItemTable

    Returns
    -------
    list of list of str
        Cells by row; numbers have four digits.
    """
    return [
        [f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in row]
        for row in table.rows
    ]


def verdict_line(verdict: ClaimVerdict) -> str:
    """Format a claim, the measurement, and whether the claim holds.

    Parameters
    ----------
    verdict : ClaimVerdict

    Returns
    -------
    str
        Markdown.
    """
    why = f" {_sentence(verdict.why)}" if verdict.why else ""
    return (
        f"**The thesis:** {_sentence(verdict.claim)} **Here:** {_sentence(verdict.here)} "
        f"**Holds: {verdict.holds}.**{why}"
    )


def index_page(
    items: Sequence[ThesisItem], records: Mapping[str, ItemRecord], *, published: bool = False
) -> str:
    """Build the index: every claim of the abstract with its verdict, and every item.

    Parameters
    ----------
    items : sequence of ThesisItem
        All items.
    records : mapping of str to ItemRecord
        Records of the items made, by name.
    published : bool
        Link figures to the picture sheet of their chapter, because the folder has no page per
        figure.

    Returns
    -------
    str
        Markdown.
    """
    made = sum(item.name in records for item in items)
    lines = ["# Tables and figures of the thesis", "", _INTRODUCTION]
    lines += [f"{made} of {len(items)} items are available{_settings(records)}.", "", _REGENERATE]
    lines += [
        "## Claims of the abstract",
        "",
        "| claim | here | holds | item |",
        "|---|---|---|---|",
    ]
    for claim in ABSTRACT:
        rows = [
            f"| {claim} | {_sentence(verdict.here)} | {verdict.holds} "
            f"| [{item.kind} {item.number}]({_link(item, published)}) |"
            for item in items
            if item.name in records
            for verdict in records[item.name].verdicts
            if verdict.claim == claim
        ]
        lines += rows or [f"| {claim} | | not measured | |"]
    for kind in ("table", "figure"):
        last = "claims hold" if kind == "table" else "state"
        lines += ["", f"## {kind.capitalize()}s", "", f"| | title | {last} |", "|---|---|---|"]
        lines += [
            _index_row(item, records.get(item.name), published)
            for item in items
            if item.kind == kind
        ]
    lines += ["", "## Short names", "", "| name | meaning |", "|---|---|"]
    lines += [f"| {name} | {words} |" for name, words in _SHORT_NAMES]
    return "\n".join(lines) + "\n"


def sheet_name(chapter: int) -> str:
    """Return the file name of a chapter's picture sheet.

    Parameters
    ----------
    chapter : int
        Number of the chapter.

    Returns
    -------
    str
    """
    return f"chapter-{chapter}.jpg"


def _link(item: ThesisItem, published: bool) -> str:
    """Return the file that shows an item."""
    return sheet_name(item.chapter) if published and item.kind == "figure" else f"{item.name}.md"


def _index_row(item: ThesisItem, record: ItemRecord | None, published: bool) -> str:
    title = item.number if record is None else f"[{item.number}]({_link(item, published)})"
    state = f"not regenerable: {item.reason}" if item.make is None else "not made yet"
    return f"| {title} | {item.title} | {state if record is None else _counts(record.verdicts)} |"


def _settings(records: Mapping[str, ItemRecord]) -> str:
    """Describe the kind of runs behind the records."""
    commands = [record.command for record in records.values()]
    own = sum("--data" not in command for command in commands)
    quick = sum("--quick" in command for command in commands)
    runs = len({record.fingerprint for record in records.values()})
    text = ""
    if own:
        text += f", {own} of them without `--data`: rendered by the project or from scikit-image"
    if quick:
        text += f", {quick} of them by a quick run: few small images, weak verdicts"
    if runs > 1:
        text += f"; they come from {runs} runs that differ in options, data or version"
    return text


def _counts(verdicts: Sequence[ClaimVerdict]) -> str:
    """Count the verdicts, as in "no, undetermined (3)"."""
    many = Counter(verdict.holds for verdict in verdicts)
    return ", ".join(
        f"{holds} ({many[holds]})" if many[holds] > 1 else holds for holds in Holds if many[holds]
    )


def _sentence(text: str) -> str:
    """Add a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '!', '?', ':')) else '.'}"
