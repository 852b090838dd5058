"""Making a data set: scene after scene, each whole or not at all, so that an interrupted run goes
on where it stopped.

`manifest.json` is written before the first scene that lacks and says what the run is to become; a
folder that holds another run is left alone. A scene that is there is kept if it is the one planned
and none of its files has changed since.

Limits: a kept scene may come from another version of the program; its `scene.json` says which.
"""

import gc
import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from isc_core.errors import InputError
from isc_core.io.atomic import new_file, require_writable_file
from isc_core.progress import Monitor, ProgressEvent

from ..capture.recipe import PictureSettings, Recipe, Sources, photograph
from ..rendering.bsdfs import load_drjit
from ..scene.variant import has_llvm, load_mitsuba
from .card import card
from .description import describe_picture
from .reading import MANIFEST, read_description, read_object, require_intact
from .scene_folder import checksum, write_scene
from .splits import SPLITS, Choices, make_pools

SCHEMA_VERSION = 1
KIND = "isc synth data set"
MOST_SCENES = 100_000  # seeds have five digits in folder names
_LOOKING = 0.02  # of the whole, for what is there already
# scenes after which compiled kernels are let go; those needed again come from Dr.Jit's files
_KERNELS_KEPT = 50
_LITTER = (".DS_Store", "Thumbs.db", "desktop.ini")


@dataclass(frozen=True)
class DatasetSettings:
    """A data set: the scenes of the seeds `seed` ... `seed` + `count` - 1, drawn from `choices`,
    taken as `picture` says, with the files of `sources`. Raises `InputError` for an impossible
    count or seed.
    """

    count: int
    seed: int = 0
    choices: Choices = field(default_factory=Choices)
    picture: PictureSettings = field(default_factory=PictureSettings)
    sources: Sources = field(default_factory=Sources)

    def __post_init__(self) -> None:
        if not (self.count >= 1 and self.seed >= 0 and self.seed + self.count <= MOST_SCENES):
            raise InputError(
                f"{self.count} scenes from seed {self.seed} on cannot be made: their seeds have to be from 0 to {MOST_SCENES - 1}"
            )


@dataclass(frozen=True)
class PlannedScene:
    """One scene to be made, and its split."""

    split: str
    recipe: Recipe


@dataclass(frozen=True)
class DatasetOutcome:
    """How many scenes were `made`, and how many were there already and `kept`."""

    made: int
    kept: int


def plan(run: DatasetSettings) -> tuple[PlannedScene, ...]:
    """All scenes of a run, in the order of their seeds.

    Raises `InputError` for splits and sources that cannot be had.
    """
    pools = make_pools(run.choices, run.sources)
    seeds = range(run.seed, run.seed + run.count)
    return tuple(
        PlannedScene(pools.split_of(seed), pools.recipe(seed, run.picture, run.sources))
        for seed in seeds
    )


def make_dataset(run: DatasetSettings, out: Path, monitor: Monitor | None = None) -> DatasetOutcome:
    """Makes the scenes of `run` that `out` lacks.

    Raises `InputError` where `out` holds anything else, and `Cancelled`.
    """
    monitor = monitor or Monitor()
    load_mitsuba()
    planned = plan(run)
    settings = describe_run(run)
    require_this_run(out, settings, run.count)
    missing = []
    for index, scene in enumerate(planned):
        monitor.report("looking for finished scenes", _LOOKING * index / len(planned))
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
    """Keeps the memory of a long run flat: renderers hold buffers in reference cycles, and Dr.Jit
    keeps every kernel that it compiled.
    """
    gc.collect()
    if index % _KERNELS_KEPT == _KERNELS_KEPT - 1 and has_llvm():
        drjit = load_drjit()
        drjit.flush_kernel_cache()
        drjit.flush_malloc_cache()


def _constant(text: str, left: str, monitor: Monitor) -> Callable[[ProgressEvent], None]:
    """Progress inside a scene, under the scene's own text; files take the last tenth."""
    return lambda event: monitor.progress(ProgressEvent(text, 0.9 * event.fraction, left))


def _time_left(seconds: float, done: int, total: int) -> str:
    """What the scenes before suggest, in words; nothing before the first one."""
    if not done:
        return ""
    left = seconds / done * (total - done)
    return f"{left:.0f} s left" if left < 90 else f"{left / 60:.0f} min left"


def is_finished(folder: Path, scene: PlannedScene) -> bool:
    """Whether the folder holds this very scene, undamaged."""
    try:
        content = read_description(folder)
        require_intact(folder, content)
    except InputError:
        return False
    return content.get("split") == scene.split and content.get("picture") == describe_picture(
        scene.recipe.picture
    )


def describe_run(run: DatasetSettings) -> dict[str, Any]:
    """What decides the scenes of a run, whatever their number: two runs are the same where this is
    equal.
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
    """Raises `InputError` unless `out` is new, empty, or holds this run, begun or finished, with no
    more scenes than `count`.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file: name a folder")
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
        raise InputError(
            f"{path} is not the manifest of a data set of isc synth: choose another folder"
        )
    if different := [name for name in settings if theirs.get(name) != settings[name]]:
        name = different[0]
        raise InputError(
            f"{out} holds another run ({name} {_short(theirs.get(name))}, not {_short(settings[name])}): choose another folder"
        )
    if found["count"] > count:
        raise InputError(
            f"{out} holds a run of {found['count']} scenes: ask for at least as many, or choose another folder"
        )


def _short(value: Any) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"


def _described(path: Path | None) -> dict[str, str] | None:
    """A user's file by its name and content. Raises `InputError` where it cannot be read."""
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
    """`manifest.json` and `README.md`; what says so already is left alone."""
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
        "README.md": card(settings, run.count, splits),
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
