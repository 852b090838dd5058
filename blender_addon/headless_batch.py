"""Photos and results, one after the other, to objects in .blend files and renders of them; without
a window.
"""

import argparse
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from isc_core.atomic import new_file, require_writable_file
from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.status_lines import status_lines

from .files.result_arrays import ARRAYS, DESCRIPTION, read_description
from .headless_sources import Source, find_sources, output_files
from .operators.messages import notes_of
from .operators.request import Method, Request
from .operators.result import build_in_one_step
from .registration import register
from .scene.build import BuildOptions
from .scene.provenance import find
from .settings.preferences import choices, worker_environment
from .worker.process import Job, Worker, start, start_arrays

_POLL_SECONDS = 0.05
_FORMATS = {".png": ("PNG", "16"), ".exr": ("OPEN_EXR", "32")}


@dataclass(frozen=True)
class Plan:
    """What is to be made of one source:

    `blend` and `picture` are the files to write, None for none.
    """

    source: Source
    blend: Path | None
    picture: Path | None


@dataclass(frozen=True)
class Said:
    """A line each.

    `notes`: what the work says of a source's result, such as why it is doubtful. `failures`:
    sources without a result.
    """

    notes: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


def run(options: argparse.Namespace, monitor: Monitor) -> Said:
    """Does what the options of `command_line` say, and returns what is to be said of the sources.

    Raises `InputError` before any work where they cannot be followed; `Cancelled`.
    """
    plans = make_plan(options)
    if not hasattr(bpy.types.Scene, "isc"):  # not an enabled extension
        register()
    said = Said()
    with ExitStack() as stack:
        results = options.results or Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="isc-results-"))
        )
        earlier: Path | None = None
        for number, plan in enumerate(plans):
            part = monitor.part(number / len(plans), (number + 1) / len(plans))
            try:
                folder, notes = _result_of(plan.source, results, options, part.part(0.0, 0.9))
                if notes:
                    said.notes.append(f"{plan.source.path}: {notes}")
                if options.output is not None or options.render is not None:
                    _make(
                        folder,
                        plan,
                        options,
                        part.part(0.9, 1.0),
                        empty=earlier is None or plan.blend != earlier,
                    )
                    earlier = plan.blend
            except InputError as error:
                said.failures.append(f"{plan.source.path}: {error}")
    return said


def make_plan(options: argparse.Namespace) -> list[Plan]:
    """What will be written, checked. Raises `InputError`."""
    if options.output is None and options.render is None and options.results is None:
        raise InputError("say what to write: -o OUT.blend, --render OUT.png or --results DIR")
    for name, least in (("samples", 1), ("max_size", 0), ("threads", 0)):
        if getattr(options, name) < least:
            raise InputError(f"--{name.replace('_', '-')} must be {least} or more")
    if not 0 < options.size < 1e6:
        raise InputError("--size must be above 0 metres")
    sources = find_sources(options.inputs, options.mask)
    blends = output_files(sources, options.output, (".blend",), "-o", together=True)
    pictures = output_files(sources, options.render, tuple(_FORMATS), "--render", together=False)
    for path in {path for path in (*blends, *pictures) if path is not None}:
        require_writable_file(path)
    return [Plan(*three) for three in zip(sources, blends, pictures, strict=True)]


# --- the work of the core -------------------------------------------------------------------------


def _result_of(
    source: Source, results: Path, options: argparse.Namespace, monitor: Monitor
) -> tuple[Path, str]:
    """The folder of the source's result, with its arrays, and what the work said of it, "" for
    nothing.
    """
    environment = worker_environment(choices(bpy.context))
    if not source.is_result:
        folder = results / source.name
        job = Job(
            photo=source.path.resolve(),
            output=folder.resolve(),
            mask=None if source.mask is None else source.mask.resolve(),
            model=options.model,
            separator=options.separator,
            illumination=options.illumination,
            max_size=options.max_size,
            threads=options.threads,
            transfer=options.transfer,
        )
        return folder, notes_of(_wait(start(job, environment), monitor))
    if not (source.path / ARRAYS).is_file():
        _wait(start_arrays(source.path.resolve(), environment), monitor)
    status = read_description(source.path / DESCRIPTION).get("status", {})
    return source.path, notes_of("\n".join(status_lines(status)))


def _wait(worker: Worker, monitor: Monitor) -> str:
    """Until the worker is done; returns its last words. No worker is left either way.

    Raises `InputError` with what it says if it fails; `Cancelled`.
    """
    try:
        while (update := worker.poll()).state == "running":
            monitor.report(update.stage, update.fraction)
            time.sleep(_POLL_SECONDS)
    except (Cancelled, KeyboardInterrupt):
        worker.kill()
        raise
    if update.state == "cancelled":
        raise Cancelled
    if update.state == "failed":
        raise InputError(update.message)
    return update.message


# --- the work of Blender --------------------------------------------------------------------------


def _make(
    folder: Path, plan: Plan, options: argparse.Namespace, monitor: Monitor, *, empty: bool
) -> None:
    """Builds the object of a result, in a new file where `empty`; saves and renders it.

    Raises `InputError`, `Cancelled`.
    """
    name = plan.source.name
    monitor.report(f"building {name}", 0.0)
    leftover = new_blend() if empty else []
    build_in_one_step(bpy.context, folder, _request(plan.source, options))
    scene = find(bpy.data.scenes, name, "scene")
    for other in leftover:
        bpy.data.scenes.remove(other)
    if plan.blend is not None:
        save_blend(plan.blend)
    if plan.picture is not None:
        monitor.report(f"rendering {name}", 0.3)
        render(scene, plan.picture)
    monitor.report(f"building {name}", 1.0)


def _request(source: Source, options: argparse.Namespace) -> Request:
    """What the add-on's panel would ask for, so that the object can be edited and decomposed again
    there.
    """
    method = Method(
        options.model, options.separator, options.illumination, options.max_size, options.samples
    )
    build = BuildOptions(
        size_metres=options.size,
        sun=options.sun,
        displacement=options.displacement,
        closed_back=options.closed_back,
        own_shadows=True if options.own_shadows else None,
        specular_from=options.specular,
        name=source.name,
    )
    photo = "" if source.is_result else _loaded(source.path)
    mask = "" if source.mask is None or not photo else _loaded(source.mask)
    return Request(image=photo, mask=mask, method=method, build=build)


def _loaded(path: Path) -> str:
    """The name of the image that shows the file, packed; nothing where Blender cannot read the
    file.
    """
    try:
        image = bpy.data.images.load(str(path.resolve()), check_existing=True)
        image.pack()
    except RuntimeError:
        return ""
    return str(image.name_full)


def new_blend() -> list[Any]:
    """A file with nothing in it; add-ons and preferences stay as they are.

    Returns the scenes that Blender insists on.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return list(bpy.data.scenes)


def save_blend(path: Path) -> None:
    """Saves the file. Raises `InputError` where it cannot."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), check_existing=False)
    except (OSError, RuntimeError) as error:
        raise InputError(f"cannot write {path}: {_last_line(error)}") from error


def render(scene: Any, path: Path) -> None:
    """Renders the scene: .png of 16 bits in the scene's view transform, or .exr of 32 bits, linear.

    Raises `InputError`.
    """
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = _FORMATS[path.suffix.lower()]
    settings.color_mode = "RGBA"
    scene.render.use_file_extension = False
    with new_file(path) as partial:
        scene.render.filepath = str(partial)
        try:
            bpy.ops.render.render(write_still=True, scene=scene.name)
        except RuntimeError as error:
            raise InputError(f"cannot render {path}: {_last_line(error)}") from error
        if not partial.is_file():
            raise InputError(f"cannot render {path}: Blender wrote nothing")


def _last_line(error: Exception) -> str:
    return str(error).strip().splitlines()[-1]
