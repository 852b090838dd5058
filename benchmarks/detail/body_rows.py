"""One row for each body of a set, kept so that an interrupted measurement continues."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..records import append_row, read_rows
from .rendering import SetKind
from .sets import bodies_in


def body_rows(
    folder: Path,
    rows: Path,
    kinds: Sequence[SetKind],
    count: int | None,
    key: str,
    measure: Callable[[Path], Mapping[str, Any]],
) -> Iterator[Mapping[str, Any]]:
    """Measure the bodies that have no row yet.

    Parameters
    ----------
    folder : Path
        The set.
    rows : Path
        JSON lines, appended to.
    kinds : sequence of SetKind
    count : int or None
        The first bodies of each kind.
    key : str
        Names what is measured; rows of another key are left alone.
    measure : callable
        From a body's folder to values that JSON can store, by name.

    Yields
    ------
    mapping
        "key", "body" and what was measured, for each of these bodies.
    """
    earlier = {row["body"]: row for row in read_rows(rows) if row["key"] == key}
    for kind in kinds:
        for body in bodies_in(folder, kind)[:count]:
            if body.name not in earlier:
                row = {"key": key, "body": body.name, **measure(body)}
                append_row(rows, row)
                earlier[body.name] = row
            yield earlier[body.name]
