"""Rows of a long measurement, appended as JSON lines, so that an interrupted run continues."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Read the rows of an earlier run.

    A last line that was cut short is removed from the file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    list of dict
        Empty if the file does not exist.
    """
    if not path.is_file():
        return []
    text = path.read_text(encoding="utf-8")
    *whole, rest = text.split("\n")
    if rest:
        path.write_text(text[: -len(rest)], encoding="utf-8")
    return [json.loads(line) for line in whole]


def append_row(path: Path, row: Mapping[str, object]) -> None:
    """Append one row to the file.

    Parameters
    ----------
    path : Path
        File of JSON lines; created if absent.
    row : mapping of str to object
        Values that JSON can store, by name.
    """
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")
