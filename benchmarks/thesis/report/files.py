"""Files of an item: NAME.md, NAME.csv, NAME.png and a record, each complete or absent.

The record is written last, so that an interrupted run leaves no item that looks complete. The
index `README.md` is built from the records.
"""

import csv
from collections.abc import Sequence
from pathlib import Path

from isc_core import __version__
from isc_core.errors import InputError
from isc_core.io.atomic import new_file

from ..drawing.style import table_figure, unify_titles
from ..measuring.context import Context
from .chapter_sheets import write_chapter_sheets
from .item import ItemContent, ThesisItem
from .pages import index_page, item_page, sheet_name, shown_cells, without_files
from .records import (
    ItemRecord,
    describe_machine,
    read_record,
    read_records,
    remove_record,
    write_record,
)


def write_item(
    item: ThesisItem, content: ItemContent, context: Context, seconds: float
) -> ItemRecord:
    """Write the files of an item and its record; remove files of an earlier run.

    Parameters
    ----------
    item : ThesisItem
        The item.
    content : ItemContent
        Its content.
    context : Context
        The run; its output folder receives the files.
    seconds : float
        Time the content took.

    Returns
    -------
    ItemRecord
        The record as written.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    folder, name = context.output, item.name
    drawings = content.figures or tuple(
        table_figure(table.header, shown_cells(table), table.caption)
        for table in content.tables[:1]
    )
    pictures = [_numbered(name, number, "png") for number in range(len(drawings))]
    lists = [_numbered(name, number, "csv") for number in range(len(content.tables))]
    before = read_record(folder, name)
    remove_record(folder, name)
    for file, figure in zip(pictures, drawings, strict=True):
        with new_file(folder / file) as partial:
            unify_titles(figure)
            figure.savefig(
                partial, format="png", metadata={"Software": None}, pil_kwargs={"optimize": True}
            )
    for file, table in zip(lists, content.tables, strict=True):
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
        content.verdicts,
    )
    _write_text(folder / f"{name}.md", item_page(item, content, record, pictures, lists))
    for file in set(before.files if before is not None else ()) - set(record.files):
        (folder / file).unlink(missing_ok=True)
    write_record(folder, record)
    return record


def write_index(folder: Path, items: Sequence[ThesisItem]) -> None:
    """Write the index `README.md` of an output folder.

    Parameters
    ----------
    folder : Path
        Output folder with records.
    items : sequence of ThesisItem
        All items.
    """
    _write_text(folder / "README.md", index_page(items, read_records(folder, items)))


def publish(source: Path, target: Path, items: Sequence[ThesisItem]) -> list[Path]:
    """Copy what is worth tracking: the index, one page per table, one picture sheet per chapter.

    Parameters
    ----------
    source : Path
        Output folder of `isc thesis all`.
    target : Path
        Folder to write; other files in it stay.
    items : sequence of ThesisItem
        All items.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        If `source` has no items, or `target` is the same folder or cannot be written.
    """
    if source.resolve() == target.resolve():
        raise InputError(
            f"{target} holds the items themselves; publish to another folder with --to"
        )
    records = read_records(source, items)
    if not records:
        raise InputError(f"{source} has no items; run `isc thesis all -o {source}` first")
    written = [
        target / sheet_name(chapter)
        for chapter in write_chapter_sheets(source, target, items, records)
    ]
    for item in items:
        if item.kind == "table" and item.name in records:
            page = (source / f"{item.name}.md").read_text(encoding="utf-8")
            written.append(_write_text(target / f"{item.name}.md", without_files(page)))
    index = index_page(items, records, published=True)
    return [*written, _write_text(target / "README.md", index)]


def item_command(item: ThesisItem, context: Context) -> str:
    """Return the command that regenerates an item.

    Parameters
    ----------
    item : ThesisItem
    context : Context
        The run whose options the command repeats.

    Returns
    -------
    str
        Folders appear by placeholder only.
    """
    words = ["isc thesis", item.kind, item.number]
    words += ["--data ROOT"] if context.data is not None else []
    words += ["--quick"] if context.quick else []
    words += [f"--seed {context.seed}"] if context.seed else []
    return " ".join(words)


def _write_text(path: Path, text: str) -> Path:
    with new_file(path) as partial:
        partial.write_text(text, encoding="utf-8")
    return path


def _numbered(name: str, number: int, suffix: str) -> str:
    return f"{name}{f'-{number + 1}' if number else ''}.{suffix}"
