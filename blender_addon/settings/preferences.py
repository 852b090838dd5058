"""What holds for all files: how many threads, where compiled kernels and results are kept."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"

import importlib.util
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from isc_core.errors import InputError

from ..worker.process import WorkerEnvironment

# The add-on's package is the parent of this one.
ADDON = (__package__ or "").rpartition(".")[0]


@dataclass(frozen=True)
class Choices:
    """The preferences as they hold now. `threads`: 0 for one each core. `cache`: folder of compiled
    kernels. `results`: folder of results that are kept, or None.
    """

    threads: int
    cache: Path
    results: Path | None


class ISC_AP_preferences(bpy.types.AddonPreferences):
    """The add-on's preferences."""

    bl_idname = ADDON

    threads: IntProperty(
        name="Threads",
        description="How many threads the work may use; 0 takes one for each core",
        default=0,
        min=0,
        max=256,
    )
    cache_folder: StringProperty(
        name="Cache Folder",
        description="Where compiled kernels, and results that are kept, are stored; empty: the extension's own folder",
        subtype="DIR_PATH",
        default="",
    )
    keep_results: BoolProperty(
        name="Keep Result Folders",
        description="Keep every result's folder (maps, mesh, preview) in the cache folder; otherwise they go when Blender is closed",
        default=False,
    )

    def draw(self, context: Any) -> None:
        """Draws them."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "threads")
        layout.prop(self, "cache_folder")
        layout.prop(self, "keep_results")
        if self.keep_results:
            layout.label(
                text=f"Results: {_base(self.cache_folder) / 'results'}", icon="FILE_FOLDER"
            )


def choices(context: Any) -> Choices:
    """The preferences in use, the usual ones where the add-on was registered without being
    installed.
    """
    addon = context.preferences.addons.get(ADDON)
    stored = None if addon is None else addon.preferences
    if stored is None:
        return Choices(0, _base("") / "kernels", None)
    base = _base(stored.cache_folder)
    return Choices(
        stored.threads, base / "kernels", base / "results" if stored.keep_results else None
    )


def _base(chosen: str) -> Path:
    if chosen:
        return Path(bpy.path.abspath(chosen))
    try:
        return Path(bpy.utils.extension_path_user(ADDON))
    except ValueError:  # not installed as an extension
        return Path(tempfile.gettempdir()) / "isc_intrinsic"


def worker_environment(chosen: Choices) -> WorkerEnvironment:
    """Blender's own Python, where the worker finds `isc_core` and the packages it needs, and where
    it keeps compiled kernels.

    Raises `InputError` if `isc_core` is not there.
    """
    inside = Path(__file__).resolve().parents[1]
    place = importlib.util.find_spec("isc_core") if not (inside / "isc_core").is_dir() else None
    if place is not None and place.submodule_search_locations:
        inside = Path(place.submodule_search_locations[0]).resolve().parent
    if not (inside / "isc_core" / "__main__.py").is_file():
        raise InputError(
            "the worker is missing (isc_core is not in the extension): install the extension again"
        )
    extensions = Path(bpy.utils.user_resource("EXTENSIONS")).resolve()
    wheels = (
        Path(path) for path in sys.path if path and Path(path).resolve().is_relative_to(extensions)
    )
    return WorkerEnvironment(
        python=Path(sys.executable), search=(inside, *wheels), cache=chosen.cache
    )


def new_folder(choice: Path | None, name: str) -> Path:
    """A new, empty folder of one run: in `choice`, or in Blender's temporary folder, which is
    removed when Blender ends.

    `name`: anything; what file systems refuse is left out. Raises `InputError` where it cannot be
    made.
    """
    plain = (
        "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name)[:60]
        or "photo"
    )
    try:
        if choice is not None:
            choice.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f"isc_{plain}_", dir=choice or bpy.app.tempdir))
    except OSError as error:
        place = choice or bpy.app.tempdir
        raise InputError(
            f"cannot write to {place} ({error.strerror}): choose another folder in the add-on's preferences"
        ) from error
