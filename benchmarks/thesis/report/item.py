"""What a table or figure of the thesis is here: its number, and the function that makes it again.

Limits: nothing here draws or computes; `registry` lists the items, `written` puts them into files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..measuring.context import Context

HOLDS = ("yes", "partly", "no", "cannot be told")
Cell = str | int | float


@dataclass(frozen=True)
class ItemTable:
    """One table. `header`: column names. `rows`: as many cells each; numbers are shown with four
    digits in Markdown and in full in the CSV file. `caption`: one line.
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
    """A claim of the thesis beside what was measured.

    `claim`: what the thesis says, with its figure (see `claims`). `here`: what was measured.
    `holds`: of `HOLDS`. `why`: one line.
    """

    claim: str
    here: str
    holds: str
    why: str = ""

    def __post_init__(self) -> None:
        if self.holds not in HOLDS:
            raise ValueError(f"a claim holds {' or '.join(HOLDS)}, not {self.holds!r}")


@dataclass(frozen=True)
class ItemContent:
    """What an item is made of: tables, figures (written and closed by `written`), `text` in
    Markdown (what one sees), and verdicts.
    """

    tables: tuple[ItemTable, ...] = ()
    figures: tuple[Figure, ...] = ()
    text: str = ""
    verdicts: tuple[ClaimVerdict, ...] = ()


@dataclass(frozen=True)
class ThesisItem:
    """A table or figure of the thesis. `kind`: "table" or "figure". `number`: as "4.5". `title`: in
    our words. `make`: computes it; None where it cannot be regenerated, which `reason` explains.
    """

    kind: str
    number: str
    title: str
    make: Callable[[Context], ItemContent] | None
    reason: str = ""

    @property
    def name(self) -> str:
        """What its files are called: "table-4.5"."""
        return f"{self.kind}-{self.number}"

    @property
    def order(self) -> tuple[int, ...]:
        """Sorts items as the thesis lists them: tables first, then by chapter and number."""
        return (self.kind != "table", *(int(part) for part in self.number.split(".")))
