"""What an item leaves behind: NAME.md, NAME.csv, NAME.png, and a record for programs, each whole or
not at all.

The record, `records/NAME.json`, is written last: an item is complete when it is there and says the
same fingerprint. The index `README.md` is made of the records.
"""

import csv
import json
import os
import platform
import subprocess
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from isc_core import __version__
from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.io.json_files import read_json

from ..drawing.style import table_figure, unify_titles
from ..measuring.context import Context
from .claims import ABSTRACT
from .item import HOLDS, ClaimVerdict, ItemContent, ItemTable, ThesisItem

RECORDS = "records"
_SCHEMA = 1
_INTRODUCTION = (
    "Every table and figure in the lists of the thesis (H. Akbar, *3D Intrinsic Scene Characteristics Extraction Framework for a Single",
    "Image*, 2016), made again on open data by `isc thesis all`; one of them by `isc thesis table 4.5` or `isc thesis figure 4.50`.",
    "",
    "The thesis measures on MIT-Berkeley-UTeM, a set with rendered highlights that is not public. `isc synth glossy-mit` is its stand-in:",
    "objects of MIT-Berkeley, or the project's own where no copy is given, under a gloss of known strength. Figures are not those of the",
    "thesis, therefore; what can be compared is which method is better, and by how much.",
    "",
)
_SHORT_NAMES = (
    (
        "PSO, ClonalG, CS",
        "searches for thresholds: a particle swarm, clonal selection, and clonal selection with chaotic numbers",
    ),
    ("CS of layers", "Chaotic Segmentation: highlights found by such thresholds and painted over"),
    (
        "SC",
        "Sparse Coding of specular-free images: SF1, of a fixed chromaticity; SF2, of two bands",
    ),
    (
        "MZK06, YCK06, YWA10, SC09",
        "separations by Mallick et al., Yoon et al. (both 2006), Yang et al. (2010), Shen & Cai (2009)",
    ),
    ("iterative, ISC", "the separation by Tan & Ikeuchi (2005), and `isc`, this project's own"),
    (
        "as published, improved",
        "a method as its authors describe it, and with this project's changes",
    ),
    (
        "doing nothing",
        "the photo itself taken for the diffuse layer: what does no better is of no use",
    ),
    ("SIRFS", "shape, light and reflectance from one image's shading (Barron & Malik 2015)"),
    ("X-SIRFS, MDR-SIRFS", "SIRFS on the diffuse layer that the separation X, or `isc`, finds"),
    (
        "SIRFS-X, SIRFS-MBP",
        "SIRFS on the photo; highlights are then taken off the reflectance that it finds, by X or by `isc`",
    ),
    ("joint", "MDR-SIRFS, whose shape and light then improve the separation"),
    ("MSE, RMS", "the mean square error, and its root"),
    (
        "LMSE",
        "the local error: in small windows, each at its best scale; 0 is perfect, 1 is an empty layer",
    ),
    ("RS-MSE", "the mean of the local errors of reflectance and shading"),
    ("K", "the number of thresholds"),
)


@dataclass(frozen=True)
class ItemRecord:
    """What is known of a written item. `fingerprint`: of the run (see `Context.fingerprint`).
    `files`: names beside the index, the Markdown file first. `seconds`: that it took. `machine`: in
    words. `verdicts`: its claims.
    """

    name: str
    fingerprint: str
    command: str
    seed: int
    version: str
    describe_machine: str
    seconds: float
    files: tuple[str, ...]
    verdicts: tuple[ClaimVerdict, ...]


def write_item(item: ThesisItem, made: ItemContent, context: Context, seconds: float) -> ItemRecord:
    """Writes the files of an item and its record; files that an earlier run left beside them are
    removed.

    Raises `InputError` where the folder cannot be written.
    """
    folder, name = context.output, item.name
    drawings = made.figures or tuple(
        table_figure(table.header, _cells(table), table.caption) for table in made.tables[:1]
    )
    pictures = [_numbered(name, number, "png") for number in range(len(drawings))]
    lists = [_numbered(name, number, "csv") for number in range(len(made.tables))]
    before = read_record(folder, name)
    _forget(folder, name)
    for file, figure in zip(pictures, drawings, strict=True):
        with new_file(folder / file) as partial:
            unify_titles(figure)
            figure.savefig(
                partial, format="png", metadata={"Software": None}, pil_kwargs={"optimize": True}
            )
    for file, table in zip(lists, made.tables, strict=True):
        with (
            new_file(folder / file) as partial,
            partial.open("w", newline="", encoding="utf-8") as stream,
        ):
            csv.writer(stream, lineterminator="\n").writerows([table.header, *table.rows])
    record = ItemRecord(
        name,
        context.fingerprint,
        item_command(item, context),
        context.seed,
        __version__,
        describe_machine(),
        round(seconds, 1),
        (f"{name}.md", *lists, *pictures),
        made.verdicts,
    )
    with new_file(folder / f"{name}.md") as partial:
        partial.write_text(item_page(item, made, record, pictures, lists), encoding="utf-8")
    for file in set(before.files if before is not None else ()) - set(record.files):
        (folder / file).unlink(missing_ok=True)
    with new_file(_record_path(folder, name)) as partial:
        partial.write_text(
            json.dumps({"schema_version": _SCHEMA, **asdict(record)}, indent=1) + "\n",
            encoding="utf-8",
        )
    return record


def read_record(folder: Path, name: str) -> ItemRecord | None:
    """The record of an item, None where there is none that can be used."""
    path = _record_path(folder, name)
    if not path.is_file():
        return None
    try:
        content: dict[str, Any] = read_json(path)
        if content.pop("schema_version") != _SCHEMA:
            return None
        verdicts = tuple(ClaimVerdict(**verdict) for verdict in content.pop("verdicts"))
        return ItemRecord(**{**content, "files": tuple(content["files"])}, verdicts=verdicts)
    except (InputError, KeyError, TypeError, ValueError, AttributeError):
        return None


def is_complete(folder: Path, name: str, fingerprint: str) -> bool:
    """Whether all files of the item are there, made by a run with this fingerprint."""
    record = read_record(folder, name)
    return (
        record is not None
        and record.fingerprint == fingerprint
        and all((folder / file).is_file() for file in record.files)
    )


def item_page(
    item: ThesisItem,
    made: ItemContent,
    record: ItemRecord,
    pictures: Sequence[str],
    lists: Sequence[str],
) -> str:
    """The item's Markdown."""
    title = f"{item.kind.capitalize()} {item.number}: {item.title}"
    parts = [f"# {title}", *(verdict_lines(verdict) for verdict in made.verdicts)]
    if not made.verdicts:
        parts.append("The thesis' abstract gives no claim for this.")
    parts += [f"![{title}]({picture})" for picture in pictures if made.figures]
    parts += [
        part
        for table in made.tables
        for part in (
            (table.caption, markdown_table(table)) if table.caption else (markdown_table(table),)
        )
    ]
    if made.text:
        parts.append(made.text.strip())
    files = ", ".join(
        f"[{file}]({file})" for file in (*lists, *(pictures if not made.figures else ()))
    )
    parts.append(
        f"Made by `{record.command}` (seed {record.seed}, ISC {record.version}, {record.machine}, {record.seconds:g} s)."
        + (f" Files: {files}." if files else "")
        + " Short names are explained in [the index](README.md#short-names)."
    )
    return "\n\n".join(parts) + "\n"


def markdown_table(table: ItemTable) -> str:
    """A table in Markdown, numbers with four digits."""
    lines = ["| " + " | ".join(table.header) + " |", "|" + "---|" * len(table.header)]
    return "\n".join(
        [
            *lines,
            *(
                "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"
                for row in _cells(table)
            ),
        ]
    )


def verdict_lines(verdict: ClaimVerdict) -> str:
    """A claim, what was measured, and whether it holds."""
    why = f" {_sentence(verdict.why)}" if verdict.why else ""
    return f"**The thesis:** {_sentence(verdict.claim)} **Here:** {_sentence(verdict.here)} **Holds: {verdict.holds}.**{why}"


def write_index(folder: Path, items: Sequence[ThesisItem]) -> None:
    """Writes README.md: what there is, the verdict of every claim of the abstract, and every item."""
    records = {
        item.name: record
        for item in items
        if (record := read_record(folder, item.name)) is not None
    }
    with new_file(folder / "README.md") as partial:
        partial.write_text(index_page(items, records), encoding="utf-8")


def index_page(items: Sequence[ThesisItem], records: dict[str, ItemRecord]) -> str:
    """The index's Markdown."""
    made = sum(item.name in records for item in items)
    lines = [
        "# The thesis' tables and figures", "",
        *_INTRODUCTION, f"{made} of {len(items)} are here{_settings(records)}.", "",
        "## What the abstract claims", "", "| claim | here | holds | where |", "|---|---|---|---|",
    ]  # fmt: skip
    for claim in ABSTRACT:
        said = [
            (name, verdict)
            for name, record in records.items()
            for verdict in record.verdicts
            if verdict.claim == claim
        ]
        lines += [
            f"| {claim} | {_sentence(v.here)} | {v.holds} | [{_spoken(name)}]({name}.md) |"
            for name, v in said
        ] or [f"| {claim} | | not measured | |"]
    for kind in ("table", "figure"):
        lines += [
            "",
            f"## {kind.capitalize()}s",
            "",
            "| | what | do its claims hold? |",
            "|---|---|---|",
        ]
        lines += [_index_row(item, records.get(item.name)) for item in items if item.kind == kind]
    lines += [
        "",
        "## Short names",
        "",
        "| name | meaning |",
        "|---|---|",
        *(f"| {name} | {words} |" for name, words in _SHORT_NAMES),
    ]
    return "\n".join(lines) + "\n"


def item_command(item: ThesisItem, context: Context) -> str:
    """What makes the item again; folders stand there by name only."""
    words = [
        "isc thesis",
        item.kind,
        item.number,
        *(["--data ROOT"] if context.data is not None else []),
    ]
    words += ["--quick"] if context.quick else []
    return " ".join([*words, *([f"--seed {context.seed}"] if context.seed else [])])


def describe_machine() -> str:
    """The processor, its cores and Python, in words."""
    return f"{_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(
            line.partition(":")[2].strip() for line in lines if line.startswith("model name")
        )
    except (OSError, StopIteration):
        pass
    try:
        done = subprocess.run(
            ["sysctl", "-n", "machdep.cpu.brand_string"], capture_output=True, text=True, check=True
        )
        return done.stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return platform.machine()


def _index_row(item: ThesisItem, record: ItemRecord | None) -> str:
    title = f"[{item.number}]({item.name}.md)" if record is not None else item.number
    state = f"not regenerable: {item.reason}" if item.make is None else "not made yet"
    said = state if record is None else _counted(record.verdicts)
    return f"| {title} | {item.title} | {said} |"


def _settings(records: dict[str, ItemRecord]) -> str:
    """What kind of runs made them, in words."""
    commands = [record.command for record in records.values()]
    quick, own = (
        sum((word in command) == wanted for command in commands)
        for word, wanted in (("--quick", True), ("--data", False))
    )
    parts = (
        [
            f", {own} of them without public data: images are the project's own rendered ones, or come with scikit-image"
        ]
        if own
        else []
    )
    return "".join(
        [
            *parts,
            f", {quick} of them by a quick run: small images and few repetitions, whose verdicts tell little",
        ]
        if quick
        else parts
    )


def _counted(verdicts: Sequence[ClaimVerdict]) -> str:
    """How many claims hold, in words: "no, cannot be told (3)"."""
    many = Counter(verdict.holds for verdict in verdicts)
    return ", ".join(
        f"{holds} ({many[holds]})" if many[holds] > 1 else holds for holds in HOLDS if many[holds]
    )


def _sentence(text: str) -> str:
    """With a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '!', '?', ':')) else '.'}"


def _spoken(name: str) -> str:
    return name.replace("-", " ")


def _cells(table: ItemTable) -> list[list[str]]:
    """The rows as they are shown, numbers with four digits."""
    return [
        [f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in row]
        for row in table.rows
    ]


def _numbered(name: str, number: int, suffix: str) -> str:
    return f"{name}{f'-{number + 1}' if number else ''}.{suffix}"


def _record_path(folder: Path, name: str) -> Path:
    return folder / RECORDS / f"{name}.json"


def _forget(folder: Path, name: str) -> None:
    """An item that is being written is not complete."""
    _record_path(folder, name).unlink(missing_ok=True)
