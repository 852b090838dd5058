"""Manifests: lists of images as CSV with a header, or as JSON lines, read as a stream.

    image,mask,name,max_size
    cup.png,cup_mask.png,cup,256

    {"image": "cup.png", "mask": "cup_mask.png", "name": "cup", "options": {"max_size": 256}}
    {"image": "s3://photos/jug.png", "transfer": "linear"}

Only `image` is required. Options are separate columns or keys, or are grouped under `options`.
Relative paths are relative to the manifest's folder. An invalid line is detected in the first pass,
before work begins; a missing file is a failure of only that image.
"""

import csv
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from ..errors import InputError
from ..io.regular_files import require_regular
from .fetch import file_system, is_url, require_object
from .item import OPTIONS, BatchItem, ImageRecipe, Options, parse_options
from .names import check_given

SUFFIXES = (".csv", ".jsonl", ".ndjson")
_MAX_LINE = 1 << 20  # characters
_COLUMNS = ("image", "mask", "name", "options")
_TEXTS = {"image", "mask", "name"}
_REMEDY = "use a .csv or .jsonl file"


class Manifest:
    """The items of a manifest; can be iterated any number of times.

    The lines' options are checked against `recipe`.
    """

    def __init__(self, location: str, recipe: ImageRecipe) -> None:
        self._location, self._recipe = location, recipe
        head, slash, _ = location.rpartition("/")
        self._base = head + slash
        self._parsed: dict[str, Options] = {}
        self._state = ""

    def __iter__(self) -> Iterator[BatchItem]:
        with _opened(self._location) as (file, state):
            self._check_unchanged(state)
            rows = (
                _csv_rows(file, self._location)
                if self._location.lower().endswith(".csv")
                else _json_rows(file, self._location)
            )
            for line, row in rows:
                yield self._item(row, line)

    def _check_unchanged(self, state: str) -> None:
        if self._state and self._state != state:
            raise InputError(
                f"{self._location} changed while it was read: run again when it is complete"
            )
        self._state = state

    def _item(self, row: dict[str, Any], line: int) -> BatchItem:
        given = (row.get(key) for key in ("image", "mask", "name"))
        image, mask, name = ("" if text is None else text for text in given)
        if not (isinstance(image, str) and isinstance(mask, str) and isinstance(name, str)):
            raise InputError(f"{self._at(line)}: image, mask and name must be text")
        if not image:
            raise InputError(f"{self._at(line)} names no image: write its path or URL under image")
        if name:
            check_given(name, self._at(line))
        options = () if row.keys() <= _TEXTS else self._options(row, line)
        location = self._resolved(image)
        return BatchItem(
            location, self._resolved(mask) if mask else "", name, options, label=location
        )

    def _at(self, line: int) -> str:
        return f"{self._location}, line {line}"

    def _resolved(self, location: str) -> str:
        return location if is_url(location) or location.startswith("/") else self._base + location

    def _options(self, row: dict[str, Any], line: int) -> Options:
        """The line's options, checked and cached: most lines share a few sets of them."""
        given = {
            key: value
            for key, value in row.items()
            if key not in _COLUMNS and value not in ("", None)
        }
        grouped = row.get("options")
        if grouped in ("", None):
            grouped = {}
        if not given and grouped == {}:
            return ()
        key = repr((sorted(given.items()), grouped))
        if key not in self._parsed:
            options = parse_options({**given, **_mapping(grouped, self._at(line))}, self._at(line))
            try:
                self._recipe.changed(options)
            except InputError as error:
                raise InputError(f"{self._at(line)}: {error}") from error
            if len(self._parsed) > 1000:
                self._parsed.clear()
            self._parsed[key] = options
        return self._parsed[key]


def _mapping(options: object, where: str) -> dict[str, object]:
    """`options` as an object: JSON text in a CSV column, the object itself in JSON lines."""
    if isinstance(options, str):
        try:
            options = json.loads(options)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{where}: options is not JSON: {error}") from error
    if not isinstance(options, dict):
        raise InputError(f'{where}: options must be an object such as {{"max_size": 256}}')
    return options


@contextmanager
def _opened(location: str) -> Iterator[tuple[TextIO, str]]:
    """The manifest's text, and a token that changes with its content.

    File names may contain bytes that are not UTF-8.
    """
    mode: dict[str, Any] = {"encoding": "utf-8-sig", "errors": "surrogateescape", "newline": ""}
    try:
        if is_url(location):
            system, path = file_system(location)
            require_object(system, path, _REMEDY)
            with system.open(path, "r", **mode) as file:
                yield file, str(system.ukey(path))
        else:
            # Streamed, so that its size needs no limit.
            require_regular(location, None, _REMEDY)
            status = Path(location).stat()
            with Path(location).open(**mode) as file:
                yield file, f"{status.st_size} {status.st_mtime_ns}"
    except OSError as error:
        raise InputError(f"{location}: cannot be read: {error.strerror or error}") from error


def _lines(file: TextIO, location: str) -> Iterator[str]:
    number = 0
    while line := file.readline(_MAX_LINE):
        number += 1
        if len(line) == _MAX_LINE:
            raise InputError(
                f"{location}, line {number} is longer than {_MAX_LINE} characters: is this a "
                "manifest?"
            )
        yield line


def _json_rows(file: TextIO, location: str) -> Iterator[tuple[int, dict[str, Any]]]:
    for number, line in enumerate(_lines(file, location), 1):
        if line.isspace():
            continue
        try:
            row = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{location}, line {number} is not JSON: {error}") from error
        if not isinstance(row, dict):
            raise InputError(
                f'{location}, line {number} is not an object: write {{"image": "cup.png"}}'
            )
        yield number, row


def _csv_rows(file: TextIO, location: str) -> Iterator[tuple[int, dict[str, Any]]]:
    reader = csv.reader(_lines(file, location), strict=True)
    try:
        header = [name.strip() for name in next(reader, [])]
        _check_header(header, location)
        for cells in reader:
            if not cells:
                continue
            if len(cells) != len(header):
                raise InputError(
                    f"{location}, line {reader.line_num} has {len(cells)} cells, the header "
                    f"{len(header)}"
                )
            yield reader.line_num, dict(zip(header, cells, strict=True))
    except csv.Error as error:
        raise InputError(f"{location}, line {reader.line_num} is not CSV: {error}") from error


def _check_header(names: list[str], location: str) -> None:
    if "image" not in names:
        raise InputError(
            f"{location}: the first line has no column `image`: start with a header such as "
            "image,mask,name"
        )
    if repeated := [name for name in names if names.count(name) > 1]:
        raise InputError(f"{location}: the column {repeated[0]!r} is repeated")
    if unknown := [
        name for name in names if name not in _COLUMNS and name.replace("-", "_") not in OPTIONS
    ]:
        raise InputError(
            f"{location}: unknown column {unknown[0]!r}: choose {', '.join((*_COLUMNS, *OPTIONS))}"
        )
