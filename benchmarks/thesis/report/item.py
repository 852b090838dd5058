"""An item of the thesis (a table or a figure) and the content made for it.

Limits: nothing here draws or computes; `registry` lists the items, `files` writes them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..measuring.context import Context

Cell = str | int | float


class Holds(StrEnum):
    """Whether a claim of the thesis holds on the data used here."""

    YES = "yes"
    PARTLY = "partly"
    NO = "no"
    UNDETERMINED = "undetermined"


@dataclass(frozen=True)
class ItemTable:
    """One table.

    Attributes
    ----------
    header : tuple of str
        Column names.
    rows : tuple of tuple of Cell
        Rows of the header's length. Numbers are shown with four digits in Markdown and in full in
        the CSV file.
    caption : str
        One line.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""

    def __post_init__(self) -> None:
        if any(len(row) != len(self.header) for row in self.rows):
            raise ValueError(
                f"each row of {self.caption or 'a table'} must have {len(self.header)} cells"
            )


@dataclass(frozen=True)
class ClaimVerdict:
    """A claim of the thesis and the corresponding measurement.

    Attributes
    ----------
    claim : str
        The claim with its figure, see `claims`.
    here : str
        The measurement.
    holds : Holds
        Whether the claim holds.
    why : str
        Reason, one line; may be empty.
    """

    claim: str
    here: str
    holds: Holds
    why: str = ""


@dataclass(frozen=True)
class ItemContent:
    """Content of an item.

    Attributes
    ----------
    tables : tuple of ItemTable
        Tables, the main one first.
    figures : tuple of Figure
        Figures; `files.write_item` saves them.
    text : str
        Explanation in Markdown.
    verdicts : tuple of ClaimVerdict
        Verdicts on claims of the abstract.
    """

    tables: tuple[ItemTable, ...] = ()
    figures: tuple[Figure, ...] = ()
    text: str = ""
    verdicts: tuple[ClaimVerdict, ...] = ()


@dataclass(frozen=True)
class ThesisItem:
    """A table or figure of the thesis.

    Attributes
    ----------
    kind : str
        "table" or "figure".
    number : str
        As in "4.5".
    title : str
        Title in this project's words.
    make : callable or None
        Computes the content; None if the item cannot be regenerated.
    reason : str
        Why the item cannot be regenerated.
    """

    kind: str
    number: str
    title: str
    make: Callable[[Context], ItemContent] | None
    reason: str = ""

    @property
    def name(self) -> str:
        """Stem of its files, as in "table-4.5"."""
        return f"{self.kind}-{self.number}"

    @property
    def chapter(self) -> int:
        """Chapter of the thesis."""
        return int(self.number.partition(".")[0])

    @property
    def order(self) -> tuple[int, ...]:
        """Sort key: tables first, then chapter and number."""
        return (self.kind != "table", *(int(part) for part in self.number.split(".")))
