"""Records of written items: one JSON file per item, written last.

An item is complete if its record exists, names the same fingerprint and lists files that exist.
"""

import json
import os
import platform
import subprocess
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from isc_core.errors import InputError
from isc_core.io.atomic import new_file
from isc_core.io.json_files import read_json

from .item import ClaimVerdict, Holds, ThesisItem

RECORDS = "records"
_SCHEMA = 2


@dataclass(frozen=True)
class ItemRecord:
    """What is known of a written item.

    Attributes
    ----------
    name : str
        Name of the item, as in "table-4.5".
    fingerprint : str
        Fingerprint of the run, see `Context.fingerprint`.
    command : str
        Command that regenerates the item.
    seed : int
        Seed of the run.
    version : str
        Version of ISC.
    machine : str
        Processor, cores and Python version.
    seconds : float
        Time the item took.
    files : tuple of str
        File names relative to the index; the Markdown file first.
    verdicts : tuple of ClaimVerdict
        Verdicts on claims of the abstract.
    """

    name: str
    fingerprint: str
    command: str
    seed: int
    version: str
    machine: str
    seconds: float
    files: tuple[str, ...]
    verdicts: tuple[ClaimVerdict, ...]


def write_record(folder: Path, record: ItemRecord) -> None:
    """Write a record.

    Parameters
    ----------
    folder : Path
        Output folder; the records lie below it.
    record : ItemRecord
    """
    content = {"schema_version": _SCHEMA, **asdict(record)}
    with new_file(_record_path(folder, record.name)) as partial:
        partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def read_record(folder: Path, name: str) -> ItemRecord | None:
    """Read the record of an item.

    Parameters
    ----------
    folder : Path
        Output folder.
    name : str
        Name of the item.

    Returns
    -------
    ItemRecord or None
        None if there is no usable record; a damaged or outdated one counts as none.
    """
    path = _record_path(folder, name)
    if not path.is_file():
        return None
    try:
        content: dict[str, Any] = read_json(path)
        if content.pop("schema_version") != _SCHEMA:
            return None
        verdicts = tuple(
            ClaimVerdict(**{**verdict, "holds": Holds(verdict["holds"])})
            for verdict in content.pop("verdicts")
        )
        return ItemRecord(**{**content, "files": tuple(content["files"])}, verdicts=verdicts)
    except (InputError, KeyError, TypeError, ValueError, AttributeError):
        return None


def read_records(folder: Path, items: Iterable[ThesisItem]) -> dict[str, ItemRecord]:
    """Read the records of several items.

    Parameters
    ----------
    folder : Path
        Output folder with records.
    items : iterable of ThesisItem

    Returns
    -------
    dict of str to ItemRecord
        By the item's name; items without a record, or of which a file is missing, are omitted.
    """
    records = ((item.name, read_record(folder, item.name)) for item in items)
    return {
        name: record
        for name, record in records
        if record is not None and _has_files(folder, record)
    }


def remove_record(folder: Path, name: str) -> None:
    """Remove a record, so that its item counts as incomplete.

    Parameters
    ----------
    folder : Path
        Output folder with records.
    name : str
        The item.
    """
    _record_path(folder, name).unlink(missing_ok=True)


def is_complete(folder: Path, name: str, fingerprint: str) -> bool:
    """Check whether all files of an item exist and come from a run with this fingerprint.

    Parameters
    ----------
    folder : Path
        Output folder with records.
    name : str
        The item.
    fingerprint : str
        Fingerprint of the run.

    Returns
    -------
    bool
    """
    record = read_record(folder, name)
    return record is not None and record.fingerprint == fingerprint and _has_files(folder, record)


def describe_machine() -> str:
    """Describe the processor, its cores and the Python version."""
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


def _has_files(folder: Path, record: ItemRecord) -> bool:
    return all((folder / file).is_file() for file in record.files)


def _record_path(folder: Path, name: str) -> Path:
    return folder / RECORDS / f"{name}.json"
