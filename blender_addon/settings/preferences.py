"""The add-on's preferences: number of threads, folders of compiled kernels and of results, and how
many results are kept for the next run.
"""
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

from ..files.result_cache import ResultCache
from ..worker.commands import WorkerEnvironment

_GIGABYTE, _USUAL_GIGABYTES = 1 << 30, 4
_ROOT = Path(__file__).resolve().parents[1]
# The package that Blender registers is the parent of this one.
ADDON = (__package__ or "").rpartition(".")[0]


@dataclass(frozen=True)
class PreferenceValues:
    """The current preferences.

    Attributes
    ----------
    threads : int
        Number of threads; 0 uses one per core.
    cache : Path
        Folder of compiled kernels.
    results : Path or None
        Folder of results to keep; None keeps none.
    earlier : ResultCache or None
        Results of earlier runs; None to use none.
    """

    threads: int
    cache: Path
    results: Path | None
    earlier: ResultCache | None = None


class ISC_AP_preferences(bpy.types.AddonPreferences):
    """The add-on's page in Blender's preferences."""

    bl_idname = ADDON

    threads: IntProperty(
        name="Threads",
        description="Number of threads of the worker process (0 uses one per core)",
        default=0,
        min=0,
        max=256,
    )
    cache_folder: StringProperty(
        name="Cache Folder",
        description="Folder for results; if empty, the extension's own folder is used",
        subtype="DIR_PATH",
        default="",
    )
    cache_limit: IntProperty(
        name="Cache Limit",
        description=(
            "Maximum size of the cached results in gigabytes (0 caches none). A cached result is "
            "used again for the same photo and settings; the oldest are deleted first"
        ),
        default=_USUAL_GIGABYTES,
        min=0,
        max=1000,
    )
    keep_results: BoolProperty(
        name="Keep Result Folders",
        description=(
            "Keep the folder of every result (maps, mesh, preview) in the cache folder instead of "
            "deleting it when Blender exits"
        ),
        default=False,
    )

    def draw(self, context: Any) -> None:
        """Draw the page.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context; not used.
        """
        del context
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "threads")
        layout.prop(self, "cache_folder")
        layout.prop(self, "cache_limit")
        layout.prop(self, "keep_results")
        if self.keep_results:
            folder = _base_folder(self.cache_folder) / "results"
            layout.label(text=f"Results: {folder}", icon="FILE_FOLDER")


def read_preferences(context: Any) -> PreferenceValues:
    """Return the current preferences.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.

    Returns
    -------
    PreferenceValues
        The defaults where the add-on was registered without being installed.
    """
    addon = context.preferences.addons.get(ADDON)
    stored = None if addon is None else addon.preferences
    if stored is None:
        # Not installed: results are kept for as long as this Blender runs.
        earlier = ResultCache(Path(bpy.app.tempdir) / "earlier", _USUAL_GIGABYTES * _GIGABYTE)
        return PreferenceValues(0, _base_folder("") / "kernels", None, earlier)
    base = _base_folder(stored.cache_folder)
    return PreferenceValues(
        stored.threads,
        base / "kernels",
        base / "results" if stored.keep_results else None,
        ResultCache(base / "earlier", stored.cache_limit * _GIGABYTE)
        if stored.cache_limit
        else None,
    )


def _base_folder(chosen: str) -> Path:
    if chosen:
        return Path(bpy.path.abspath(chosen))
    try:
        return Path(bpy.utils.extension_path_user(ADDON))
    except ValueError:  # not installed as an extension
        return Path(tempfile.gettempdir()) / "isc_intrinsic"


def worker_environment(preferences: PreferenceValues) -> WorkerEnvironment:
    """Return what a worker runs with: Blender's Python, `isc_core` and the extension's packages.

    Parameters
    ----------
    preferences : PreferenceValues
        The current preferences.

    Returns
    -------
    WorkerEnvironment
        Interpreter, search path and cache.

    Raises
    ------
    InputError
        If `isc_core` is missing.
    """
    inside = _ROOT
    spec = importlib.util.find_spec("isc_core") if not (inside / "isc_core").is_dir() else None
    if spec is not None and spec.submodule_search_locations:
        inside = Path(spec.submodule_search_locations[0]).resolve().parent
    if not (inside / "isc_core" / "__main__.py").is_file():
        raise InputError(
            "the worker is missing (the extension has no isc_core): install the extension again"
        )
    extensions = Path(bpy.utils.user_resource("EXTENSIONS")).resolve()
    wheels = (
        Path(path) for path in sys.path if path and Path(path).resolve().is_relative_to(extensions)
    )
    return WorkerEnvironment(
        python=Path(sys.executable), search=(inside, *wheels), cache=preferences.cache
    )


def create_run_folder(parent: Path | None, name: str) -> Path:
    """Create a new, empty folder for one run.

    Parameters
    ----------
    parent : Path or None
        Folder to create it in; None uses Blender's temporary folder, which Blender deletes on exit.
    name : str
        Part of the folder's name; unsupported characters are replaced.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        If it cannot be created.
    """
    plain = (
        "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name)[:60]
        or "photo"
    )
    try:
        if parent is not None:
            parent.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f"isc_{plain}_", dir=parent or bpy.app.tempdir))
    except OSError as error:
        raise InputError(
            f"cannot write to {parent or bpy.app.tempdir} ({error.strerror}): "
            "choose another folder in the add-on's preferences"
        ) from error
