"""Generation of the glossy sets object by object; each folder is written completely or not at all,
so that an interrupted run can continue.

`run.json` is written first and identifies the folder; a folder with other files, or a run with
other settings, is rejected. Objects, and the physical variant, may be added to a run.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from isc_core.datasets.mit_berkeley import ILLUMINATIONS, check_request, list_objects
from isc_core.errors import InputError
from isc_core.io.atomic import new_file, require_writable_file
from isc_core.progress import Monitor

from ..dataset.description import versions
from ..dataset.reading import read_object
from ..scene.tracing import Tracer
from ..scene.variant import load_mitsuba
from ..shapes.height_field import mesh_of_height
from .card import card, command, index
from .files import RECORD, exposed, is_written, write_object
from .layers import make_layers
from .settings import LIGHTS, GlossySettings, root_name, root_names
from .source import load_source

RUN = "run.json"
KIND = "isc synth glossy-mit"
_LITTER = (".DS_Store", "Thumbs.db", "desktop.ini")


@dataclass(frozen=True)
class GlossyOutcome:
    """The result of a run.

    Attributes
    ----------
    roots : tuple of str
        The data sets, relative to the output folder.
    made, kept : int
        How many objects were made, and how many already existed.
    """

    roots: tuple[str, ...]
    made: int
    kept: int


def make_glossy(
    root: Path,
    out: Path,
    settings: GlossySettings,
    objects: Sequence[str] | None = None,
    monitor: Monitor | None = None,
) -> GlossyOutcome:
    """Make the glossy sets of some objects.

    Parameters
    ----------
    root : Path
        Folder of the MIT-Berkeley set.
    out : Path
        Folder of the output.
    settings : GlossySettings
        Levels, samples, seed, exponent and variant.
    objects : sequence of str, optional
        Their names; all by default.
    monitor : Monitor, optional
        Progress and cancellation.

    Returns
    -------
    GlossyOutcome
        The result.

    Raises
    ------
    InputError
        For unknown objects, missing or damaged files, or an `out` that contains anything else.
    Cancelled
        If the user cancels.
    """
    monitor = monitor or Monitor()
    names = tuple(dict.fromkeys(objects)) if objects else list_objects(root, "laboratory")
    for name in names:
        for illumination in ILLUMINATIONS:
            check_request(root, name, illumination, "diffuse")
    if Path(os.path.realpath(out)).is_relative_to(os.path.realpath(root)):
        raise InputError(f"{out} is inside the data set: choose a folder outside of {root}")
    _require_this_run(out, settings)
    _write_json(out / RUN, {"kind": KIND, "settings": settings.to_json()})
    roots = _known_roots(out, settings)
    made = 0
    for number, name in enumerate(names):
        part = monitor.part(number / len(names), (number + 1) / len(names))
        part.report(f"{name} ({number + 1} of {len(names)})", 0.0)
        made += _make_object(root, out, name, settings, part)
        _write_cards(out, settings, roots)
    return GlossyOutcome(root_names(settings), made, len(names) - made)


def _make_object(
    root: Path, out: Path, name: str, settings: GlossySettings, monitor: Monitor
) -> bool:
    """Make the missing files of an object; return whether there were any."""
    missing = [
        prefix
        for prefix in _prefixes(settings)
        if not all(is_written(out / path, name) for path in _paths(prefix, settings))
    ]
    if not missing:
        return False
    source = load_source(root, name)
    for step, prefix in enumerate(missing):
        part = monitor.part(step / len(missing), (step + 1) / len(missing))
        tracer = Tracer(mesh_of_height(source.height)) if prefix else None
        variant = str(load_mitsuba().variant()) if tracer else None
        for number, (light, layers) in enumerate(
            make_layers(source, settings, part.part(0.0, 0.5), tracer).items()
        ):
            part.report(f"{name}: files of {light}", 0.5 + 0.5 * number / len(LIGHTS))
            picture = exposed(source, layers, max(settings.levels))
            for level in settings.levels:
                write_object(out / prefix / root_name(level, light), picture, level, variant)
    return True


def _prefixes(settings: GlossySettings) -> tuple[str, ...]:
    """Subfolders of the exact sets, and of the physical ones."""
    return ("", "physical") if settings.physical else ("",)


def _paths(prefix: str, settings: GlossySettings) -> list[Path]:
    return [Path(prefix) / root_name(level, light) for level in settings.levels for light in LIGHTS]


def _known_roots(out: Path, settings: GlossySettings) -> tuple[str, ...]:
    """The sets of this run, and those of earlier runs."""
    everything = root_names(GlossySettings(**{**vars(settings), "physical": True}))
    return tuple(
        name for name in everything if name in root_names(settings) or (out / name).is_dir()
    )


def _require_this_run(out: Path, settings: GlossySettings) -> None:
    """Check that `out` is new, empty or contains a run with these settings."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file: choose a folder")
    require_writable_file(out / RUN)
    if not (out / RUN).is_file():
        if out.is_dir() and any(entry.name not in _LITTER for entry in out.iterdir()):
            raise InputError(
                f"{out} is not empty and not a run of isc synth glossy-mit: choose another folder"
            )
        return
    found, wanted = read_object(out / RUN), settings.to_json()
    theirs = found.get("settings")
    if found.get("kind") != KIND or not isinstance(theirs, dict):
        raise InputError(f"{out / RUN} is not of isc synth glossy-mit: choose another folder")
    for name, value in wanted.items():
        if theirs.get(name) != value:
            raise InputError(
                f"{out} contains another run ({name} {theirs.get(name)}, not {value}): choose "
                "another folder"
            )


def _write_cards(out: Path, settings: GlossySettings, roots: tuple[str, ...]) -> None:
    """Write `scene.json` and `README.md` of every set, from the records of its objects, and
    the index.
    """
    for level in settings.levels:
        for light in LIGHTS:
            for name in (root_name(level, light), f"physical/{root_name(level, light)}"):
                if name not in roots:
                    continue
                records = sorted((out / name / "laboratory").glob(f"*/{RECORD}"))
                scene = {
                    "kind": KIND,
                    **settings.to_json(),
                    "level": level,
                    "light": light,
                    "physical": name.startswith("physical/"),
                    "command": command(settings),
                    "versions": versions(),
                    "licence": "research data under its own terms; do not redistribute",
                    "objects": {path.parent.name: read_object(path) for path in records},
                }
                _write_json(out / name / "scene.json", scene)
                _write_text(out / name / "README.md", card(name, level, light, settings))
    _write_text(out / "README.md", index(settings, roots))


def _write_json(path: Path, content: dict[str, Any]) -> None:
    _write_text(path, json.dumps(content, indent=1) + "\n")


def _write_text(path: Path, text: str) -> None:
    with new_file(path) as partial:
        partial.write_text(text, encoding="utf-8")
