"""The folder of a validation: `report.json`, `report.html`, `summary.md`, and
`evidence/SCENE/*.exr` where something was rejected.

It is written completely or not at all. An earlier report is replaced, together with the evidence
that it lists.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path

from isc_core.errors import InputError
from isc_core.io.atomic import new_folder, require_writable
from isc_core.io.exr import write_channels
from isc_core.io.json_files import read_json
from isc_core.progress import Monitor

from ..measurement.measure import SceneResult
from .cases import make_cases, worst_scenes, write_evidence
from .html import page
from .markdown import summary
from .outcome import ValidationOutcome, to_json

FILES = ("report.json", "report.html", "summary.md")
_EVIDENCE = re.compile(r"evidence/[^/\\.][^/\\]*/[a-z_]+\.exr")


def require_writable_report(folder: Path) -> None:
    """Check that a report can be written to a folder.

    Parameters
    ----------
    folder : Path
        The folder of the report; it need not exist.

    Raises
    ------
    InputError
        If it cannot, for example because the folder has other files.
    """
    require_writable(folder, report_files(folder))


def write_report(outcome: ValidationOutcome, folder: Path, monitor: Monitor) -> None:
    """Write the report of a validation; runs the scenes that it shows once more.

    Parameters
    ----------
    outcome : ValidationOutcome
        The validation.
    folder : Path
        The folder to write; an earlier report is replaced.
    monitor : Monitor
        Progress and cancellation.

    Raises
    ------
    InputError
        If the folder cannot be written.
    Cancelled
        If the user cancels.
    """
    cases = make_cases(outcome.measured, outcome.options, monitor.part(0, 0.7))
    with new_folder(folder, report_files(folder)) as partial:
        evidence = _write_evidence(outcome, partial, monitor.part(0.7, 0.95))
        monitor.report("writing the report", 0.95)
        text = json.dumps(to_json(outcome, evidence), indent=1, ensure_ascii=False, allow_nan=False)
        (partial / "report.json").write_text(text + "\n", encoding="utf-8")
        (partial / "report.html").write_text(page(outcome, cases, evidence), encoding="utf-8")
        (partial / "summary.md").write_text(summary(outcome), encoding="utf-8")


def _write_evidence(outcome: ValidationOutcome, folder: Path, monitor: Monitor) -> tuple[str, ...]:
    """Maps of the scenes that violate a bound or fail a check; file names relative to `folder`."""
    wanted: dict[tuple[str, str], SceneResult] = {}
    for verdict in outcome.verdicts:
        if verdict.broken:
            worst = worst_scenes(verdict, outcome.figures, outcome.measured)
            wanted |= {(scene.facts.name, verdict.bound.stage): scene for scene in worst}
    names: list[str] = []
    for done, ((name, stage), scene) in enumerate(wanted.items()):
        monitor.report("writing evidence", done / len(wanted))
        files = write_evidence(
            folder / "evidence" / name, scene, stage, outcome.options, monitor.part(1, 1)
        )
        names += [f"evidence/{name}/{file}" for file in files]
    for check in outcome.checks:
        if not check.passed and check.maps:
            place = folder / "evidence" / check.scene
            place.mkdir(parents=True, exist_ok=True)
            write_channels(place / "render_check.exr", check.maps)
            names.append(f"evidence/{check.scene}/render_check.exr")
    return tuple(dict.fromkeys(names))


def report_files(folder: Path) -> Sequence[str]:
    """Return the names of a report's files, the evidence listed by an existing report included.

    Parameters
    ----------
    folder : Path
        The folder of the report; it need not exist.

    Returns
    -------
    sequence of str
        Paths relative to `folder`. Listed names outside of `evidence/SCENE/` are ignored.
    """
    try:
        content = read_json(folder / "report.json")
    except InputError:
        return FILES
    named = content.get("evidence") if isinstance(content, dict) else None
    return (
        (*FILES, *(name for name in named if isinstance(name, str) and _EVIDENCE.fullmatch(name)))
        if isinstance(named, list)
        else FILES
    )
