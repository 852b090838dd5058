"""Rows of a long measurement, kept as lines of JSON while it runs, so that it goes on where it was
interrupted.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows kept in `path`, none where there is no such file; a last line that was cut short is
    taken out of the file, too.
    """
    if not path.is_file():
        return []
    text = path.read_text(encoding="utf-8")
    *whole, rest = text.split("\n")
    if rest:
        path.write_text(text[: -len(rest)], encoding="utf-8")
    return [json.loads(line) for line in whole]


def append_row(path: Path, row: Mapping[str, object]) -> None:
    """One row more."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")
