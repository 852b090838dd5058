"""Rendering a data set scene by scene, each written completely or not at all, so that an
interrupted run can continue.

`manifest.json` is written before the first missing scene and describes the whole run; a folder with
another run is rejected. An existing scene is kept if it is the planned one and none of its files
was modified.

Limits: a kept scene may come from another version of the program; its `scene.json` records it.
"""

import gc
import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from isc_core.errors import InputError
from isc_core.io.atomic import new_file, require_writable_file
from isc_core.progress import Monitor, ProgressEvent

from ..capture.recipe import Recipe, photograph
from ..rendering.bsdfs import load_drjit
from ..scene.variant import is_vectorised, load_mitsuba
from .card import card
from .description import describe_picture
from .reading import MANIFEST, read_description, read_object, require_intact
from .scene_folder import checksum, write_scene
from .settings import DatasetSettings
from .splits import SPLITS, make_pools

SCHEMA_VERSION = 1
KIND = "isc synth data set"
_LOOKING = 0.02  # share of the progress for checking existing scenes
# Scenes after which compiled kernels are released; Dr.Jit reloads those it needs from its files.
KERNELS_KEPT = 50
_LITTER = (".DS_Store", "Thumbs.db", "desktop.ini")


@dataclass(frozen=True)
class PlannedScene:
    """One scene to be rendered, and its split."""

    split: str
    recipe: Recipe


@dataclass(frozen=True)
class DatasetOutcome:
    """How many scenes were rendered (`made`), and how many already existed (`kept`)."""

    made: int
    kept: int


def plan(run: DatasetSettings) -> tuple[PlannedScene, ...]:
    """Return all scenes of a run, in the order of their seeds.

    Parameters
    ----------
    run : DatasetSettings
        The data set.

    Returns
    -------
    tuple of PlannedScene
        The scenes.

    Raises
    ------
    InputError
        For impossible splits and unusable sources.
    """
    pools = make_pools(run.choices, run.sources)
    seeds = range(run.seed, run.seed + run.count)
    return tuple(
        PlannedScene(pools.split_of(seed), pools.recipe(seed, run.picture, run.sources))
        for seed in seeds
    )


def make_dataset(run: DatasetSettings, out: Path, monitor: Monitor | None = None) -> DatasetOutcome:
    """Render the scenes of a data set that a folder lacks.

    Parameters
    ----------
    run : DatasetSettings
        The data set.
    out : Path
        Its folder.
    monitor : Monitor, optional
        Progress and cancellation.

    Returns
    -------
    DatasetOutcome
        Number of scenes.

    Raises
    ------
    InputError
        If `out` contains anything else, or a source cannot be used.
    Cancelled
        If the user cancels.
    """
    monitor = monitor or Monitor()
    load_mitsuba()
    planned = plan(run)
    settings = describe_run(run)
    require_this_run(out, settings, run.count)
    missing = []
    for index, scene in enumerate(planned):
        monitor.report("checking existing scenes", _LOOKING * index / len(planned))
        if not is_finished(out / scene.split / scene.recipe.name, scene):
            missing.append(scene)
    if missing:
        _write_root(out, run, settings, planned, complete=False)
    _make(missing, len(planned), out, monitor.part(_LOOKING, 1.0))
    _write_root(out, run, settings, planned, complete=True)
    return DatasetOutcome(len(missing), len(planned) - len(missing))


def _make(missing: list[PlannedScene], total: int, out: Path, monitor: Monitor) -> None:
    begin = time.monotonic()
    for index, scene in enumerate(missing):
        text = f"scene {total - len(missing) + index + 1} of {total}"
        left = _time_left(time.monotonic() - begin, index, len(missing))
        within = monitor.part(index / len(missing), (index + 1) / len(missing))
        within.report(text, 0.0, left)
        scene_itself, truth = photograph(
            scene.recipe, Monitor(_constant(text, left, within), within.cancelled)
        )
        within.report(text, 0.9, left)
        write_scene(
            out / scene.split / scene.recipe.name, scene.split, scene.recipe, scene_itself, truth
        )
        del scene_itself, truth
        _tidy(index)


def _tidy(index: int) -> None:
    """Limit the memory of a long run: renderers keep buffers in reference cycles, and Dr.Jit keeps
    every kernel that it compiled.
    """
    gc.collect()
    if index % KERNELS_KEPT == KERNELS_KEPT - 1 and is_vectorised():
        drjit = load_drjit()
        drjit.flush_kernel_cache()
        drjit.flush_malloc_cache()


def _constant(text: str, left: str, monitor: Monitor) -> Callable[[ProgressEvent], None]:
    """Progress inside a scene, with the scene's own text; files take the last tenth."""
    return lambda event: monitor.progress(ProgressEvent(text, 0.9 * event.fraction, left))


def _time_left(seconds: float, done: int, total: int) -> str:
    """Estimated remaining time; empty before the first scene is done."""
    if not done:
        return ""
    left = seconds / done * (total - done)
    return f"{left:.0f} s left" if left < 90 else f"{left / 60:.0f} min left"


def is_finished(folder: Path, scene: PlannedScene) -> bool:
    """Check whether a folder contains a scene, undamaged.

    Parameters
    ----------
    folder : Path
        The folder.
    scene : PlannedScene
        The scene.

    Returns
    -------
    bool
        False if it is missing, incomplete, modified, or another scene.
    """
    try:
        content = read_description(folder)
        require_intact(folder, content)
    except InputError:
        return False
    return content.get("split") == scene.split and content.get("picture") == describe_picture(
        scene.recipe.picture
    )


def describe_run(run: DatasetSettings) -> dict[str, Any]:
    """Return all settings that define the scenes of a run, except for their number.

    Two runs are the same if this is equal.

    Parameters
    ----------
    run : DatasetSettings
        Settings of the data set.

    Returns
    -------
    dict
        JSON values; a user's files by name and checksum.

    Raises
    ------
    InputError
        If one of these files cannot be read.
    """
    choices, sources = run.choices, run.sources
    return {
        "seed": run.seed,
        **describe_picture(run.picture),
        "shapes": list(choices.shapes),
        "materials": list(choices.materials),
        "albedos": list(choices.albedos),
        "lights": list(choices.lights),
        "splits": list(choices.splits),
        "mesh": _described(sources.mesh),
        "height": _described(sources.height),
        "albedo_image": _described(sources.albedo_image),
        "natural_lights": _described(
            sources.natural_lights and sources.natural_lights / "natural_lights.mat"
        ),
        "hdr": [_described(path) for path in sources.hdr],
    }


def require_this_run(out: Path, settings: dict[str, Any], count: int) -> None:
    """Check that a folder is new, empty, or contains this run, with at most as many scenes.

    Parameters
    ----------
    out : Path
        The folder.
    settings : dict
        The settings, from `describe_run`.
    count : int
        Number of scenes.

    Raises
    ------
    InputError
        If it contains anything else.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file: choose a folder")
    path = out / MANIFEST
    if not path.is_file():
        if out.is_dir() and any(entry.name not in _LITTER for entry in out.iterdir()):
            raise InputError(
                f"{out} is not empty and not a data set of isc synth: choose another folder"
            )
        require_writable_file(path)
        return
    require_writable_file(path)
    found = read_object(path)
    theirs = found.get("settings")
    if (
        found.get("kind") != KIND
        or not isinstance(theirs, dict)
        or not isinstance(found.get("count"), int)
    ):
        raise InputError(f"{path} is not a manifest of isc synth: choose another folder")
    if different := [name for name in settings if theirs.get(name) != settings[name]]:
        name = different[0]
        difference = f"{name} {_short(theirs.get(name))}, not {_short(settings[name])}"
        raise InputError(f"{out} contains another run ({difference}): choose another folder")
    if found["count"] > count:
        raise InputError(
            f"{out} contains a run of {found['count']} scenes: use at least as many, or choose "
            "another folder"
        )


def _short(value: Any) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"


def _described(path: Path | None) -> dict[str, str] | None:
    """A user's file by name and content."""
    if path is None:
        return None
    try:
        return {"file": path.name, "sha256": checksum(path)}
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error


def _write_root(
    out: Path,
    run: DatasetSettings,
    settings: dict[str, Any],
    planned: tuple[PlannedScene, ...],
    *,
    complete: bool,
) -> None:
    """Write `manifest.json` and `README.md` unless they are up to date."""
    counted = Counter(scene.split for scene in planned)
    splits = {name: counted[name] for name in SPLITS if counted[name]}
    manifest = {
        "schema_version": SCHEMA_VERSION,
        "kind": KIND,
        "complete": complete,
        "count": run.count,
        "settings": settings,
        "splits": splits,
        "scenes": [_listed(scene) for scene in planned],
    }
    texts = {
        MANIFEST: json.dumps(manifest, indent=1) + "\n",
        "README.md": card(run, splits),
    }
    for name, text in texts.items():
        content = text.encode()
        if not (out / name).is_file() or (out / name).read_bytes() != content:
            with new_file(out / name) as partial:
                partial.write_bytes(content)


def _listed(scene: PlannedScene) -> dict[str, Any]:
    recipe = scene.recipe
    return {
        "name": recipe.name,
        "split": scene.split,
        "seed": recipe.seed,
        "object": recipe.shape.name,
        "material": recipe.material.name,
        "albedo": recipe.albedo,
        "light": recipe.light.name,
    }
