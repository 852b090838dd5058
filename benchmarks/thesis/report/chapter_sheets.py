"""One picture sheet per chapter: all figures of the chapter, reduced, in the order of the thesis.

Problem: 71 figures as single files are too large to track. A sheet shows each at a readable size.

Limits: figures are read from their PNG files, and compressed as JPEG.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from isc_core.io.atomic import new_file

from .item import ThesisItem
from .pages import sheet_name
from .records import ItemRecord

_COLUMNS, _CELL, _GAP, _CAPTION, _LETTERS = 4, 300, 12, 20, 13  # pixels
_QUALITY = 78  # of the JPEG
_PAPER, _INK = (255, 255, 255), (0, 0, 0)


@dataclass(frozen=True)
class _Cell:
    """A figure on the sheet: its caption and its reduced picture."""

    caption: str
    picture: Image.Image


def write_chapter_sheets(
    source: Path,
    target: Path,
    items: Sequence[ThesisItem],
    records: Mapping[str, ItemRecord],
) -> list[int]:
    """Write `chapter-N.jpg` for each chapter that has figures.

    Parameters
    ----------
    source : Path
        Output folder with the PNG files of the figures.
    target : Path
        Folder of the sheets.
    items : sequence of ThesisItem
        All items, in the order of the thesis.
    records : mapping of str to ItemRecord
        Records of the items made; their PNG files are used.

    Returns
    -------
    list of int
        The chapters written.
    """
    chapters: dict[int, list[_Cell]] = {}
    for item in items:
        if item.kind == "figure" and item.name in records:
            for file in records[item.name].files:
                if file.endswith(".png") and (source / file).is_file():
                    chapters.setdefault(item.chapter, []).append(
                        _Cell(f"Figure {item.number}", _reduced(source / file))
                    )
    for chapter, cells in chapters.items():
        with new_file(target / sheet_name(chapter)) as partial:
            _composed(cells).save(partial, format="JPEG", quality=_QUALITY, optimize=True)
    return sorted(chapters)


def _reduced(path: Path) -> Image.Image:
    """Read a picture on white, as wide as a cell."""
    with Image.open(path) as opened:
        picture = opened.convert("RGBA")
    paper = Image.new("RGBA", picture.size, (*_PAPER, 255))
    height = round(picture.height * _CELL / picture.width)
    return (
        Image.alpha_composite(paper, picture)
        .convert("RGB")
        .resize((_CELL, height), Image.Resampling.LANCZOS)
    )


def _composed(cells: Sequence[_Cell]) -> Image.Image:
    """Place the cells row by row, as many columns as there are figures, at most four."""
    columns = min(_COLUMNS, len(cells))
    rows = [cells[start : start + columns] for start in range(0, len(cells), columns)]
    heights = [_CAPTION + _GAP + max(cell.picture.height for cell in row) for row in rows]
    sheet = Image.new("RGB", (_GAP + columns * (_CELL + _GAP), sum(heights) + _GAP), _PAPER)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(_LETTERS)
    top = _GAP
    for row, height in zip(rows, heights, strict=True):
        for column, cell in enumerate(row):
            left = _GAP + column * (_CELL + _GAP)
            draw.text((left, top), cell.caption, fill=_INK, font=font)
            sheet.paste(cell.picture, (left, top + _CAPTION))
        top += height
    return sheet
