"""Photos and results, one after the other, to objects in .blend files and renders, without a
window.
"""

import argparse
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from isc_core.errors import Cancelled, InputError
from isc_core.io.atomic import new_file, require_writable_file
from isc_core.progress import Monitor
from isc_core.result_files.object_folders import object_folders

from .datablocks.images import COLOR, SRGB
from .datablocks.provenance import find_tagged
from .files.result_arrays import ARRAYS
from .headless_sources import Source, find_sources, output_files
from .operators.result import build_as_undo_step
from .registration import register, unregister
from .runs.messages import join_notes, notes_of_objects, reason_line
from .runs.request import DecomposeRequest, MethodSettings
from .runs.run_steps import result_notes
from .runs.worker_run import RunOutput
from .scene.copies import OBJECT
from .scene.preparation import BuildOptions
from .settings.preferences import read_preferences, worker_environment
from .worker.commands import DecomposeJob, start_arrays, start_decompose
from .worker.process import WorkerProcess, WorkerState

_POLL_SECONDS = 0.05
_COLOR_SPACES = {"srgb": SRGB, "linear": COLOR}  # of the values of --transfer
_RENDER_FORMATS = {".png": ("PNG", "16"), ".exr": ("OPEN_EXR", "32")}


@dataclass(frozen=True)
class OutputPlan:
    """The files of one source.

    Attributes
    ----------
    source : Source
        Photo or result.
    blend : Path or None
        .blend file to write.
    render : Path or None
        Image file to render to.
    """

    source: Source
    blend: Path | None
    render: Path | None


@dataclass(frozen=True)
class BatchReport:
    """What to print at the end, one line each.

    Attributes
    ----------
    notes : list of str
        Notes on results.
    failures : list of str
        Sources without a result, and why.
    """

    notes: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


def run_batch(options: argparse.Namespace, monitor: Monitor) -> BatchReport:
    """Decompose, build, save and render all sources.

    Parameters
    ----------
    options : argparse.Namespace
        Options of `headless_command`.
    monitor : Monitor
        Receives progress and cancels.

    Returns
    -------
    BatchReport
        Notes and failures.

    Raises
    ------
    InputError
        If the options are invalid; nothing has been written then.
    Cancelled
        If the user cancels.
    """
    plans = plan_outputs(options)
    report = BatchReport()
    with ExitStack() as stack:
        if not hasattr(bpy.types.Scene, "isc"):  # not an enabled extension
            register()
            # The bpy module of Blender 4.5 does not exit while an add-on is registered.
            stack.callback(unregister)
        parent: Path = options.results or Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="isc-results-"))
        )
        previous: Path | None = None
        for number, plan in enumerate(plans):
            part = monitor.part(number / len(plans), (number + 1) / len(plans))
            try:
                folder, problem = _make_result(plan.source, parent, options, part.part(0.0, 0.9))
                if problem:
                    report.failures.append(_failure(plan.source.path, problem))
                folders = object_folders(folder) if _each(plan.source, options) else [folder]
                lines = {result.name: result_notes(result) for result in folders}
                if notes := join_notes(notes_of_objects(lines)):
                    report.notes.append(f"{plan.source.path}: {notes}")
                if options.output is not None or options.render is not None:
                    new_file_needed = previous is None or plan.blend != previous
                    _write_outputs(folder, plan, options, part.part(0.9, 1.0), new_file_needed)
                    previous = plan.blend
            except InputError as error:
                report.failures.append(_failure(plan.source.path, str(error)))
    return report


def _failure(path: Path, reason: str) -> str:
    """A line that names the source once: most messages on a file begin with its path."""
    named = reason.startswith((str(path), str(path.resolve())))
    return reason if named else f"{path}: {reason}"


def plan_outputs(options: argparse.Namespace) -> list[OutputPlan]:
    """Determine and check the files to write.

    Parameters
    ----------
    options : argparse.Namespace
        Options of `headless_command`.

    Returns
    -------
    list of OutputPlan
        One entry per source.

    Raises
    ------
    InputError
        If the options are invalid or a file cannot be written.
    """
    if options.output is None and options.render is None and options.results is None:
        raise InputError("no output: give -o OUT.blend, --render OUT.png or --results DIR")
    sources = find_sources(options.inputs, options.mask)
    blends = output_files(sources, options.output, (".blend",), "-o", together=True)
    renders = output_files(
        sources, options.render, tuple(_RENDER_FORMATS), "--render", together=False
    )
    for path in {path for path in (*blends, *renders) if path is not None}:
        require_writable_file(path)
    return [OutputPlan(*files) for files in zip(sources, blends, renders, strict=True)]


# --- the work of the core -------------------------------------------------------------------------


def _make_result(
    source: Source, parent: Path, options: argparse.Namespace, monitor: Monitor
) -> tuple[Path, str]:
    """The result folder of a source, with arrays; and what failed if some of its objects did."""
    environment = worker_environment(read_preferences(bpy.context))
    if source.is_result:
        if not (source.path / ARRAYS).is_file():
            _wait(start_arrays(source.path.resolve(), environment), monitor)
        return source.path, ""
    folder = parent / source.name
    job = DecomposeJob(
        photo=source.path.resolve(),
        output=folder.resolve(),
        mask=None if source.mask is None else source.mask.resolve(),
        model=options.model,
        separator=options.separator,
        illumination=options.illumination,
        max_size=options.max_size,
        threads=options.threads,
        transfer=options.transfer,
        camera=options.camera,
        texture_size=options.texture_size,
        highlight_odds=options.highlight_odds,
        each=_each(source, options),
        refine=options.refine,
        light_colour=options.light_colour,
    )
    try:
        _wait(start_decompose(job, environment), monitor)
    except InputError as error:
        if not job.each or not object_folders(folder):
            raise
        return folder, str(error)
    return folder, ""


def _wait(worker: WorkerProcess, monitor: Monitor) -> None:
    """Wait until the worker is done, or end it; raises `InputError` if it fails, `Cancelled`."""
    try:
        while (update := worker.poll()).state == WorkerState.RUNNING:
            monitor.report(update.stage, update.fraction)
            time.sleep(_POLL_SECONDS)
    except (Cancelled, KeyboardInterrupt):
        worker.kill()
        raise
    if update.state == WorkerState.CANCELLED:
        raise Cancelled
    if update.state == WorkerState.FAILED:
        raise InputError(update.message)


# --- the work of Blender --------------------------------------------------------------------------


def _write_outputs(
    folder: Path,
    plan: OutputPlan,
    options: argparse.Namespace,
    monitor: Monitor,
    new_file_needed: bool,
) -> None:
    """Build the object of a result; save and render it."""
    name = plan.source.name
    stage = f"building {name}"
    monitor.report(stage, 0.0)
    empty_scenes = open_empty_file() if new_file_needed else []
    request = _create_request(plan.source, options)
    build_as_undo_step(bpy.context, RunOutput(folder), request)
    first = f"{name} {object_folders(folder)[0].name}" if request.build.each else name
    scene = find_tagged(bpy.data.objects, first, OBJECT).users_scene[0]
    for other in empty_scenes:
        bpy.data.scenes.remove(other)
    if plan.blend is not None:
        save_blend(plan.blend)
    if plan.render is not None:
        stage = f"rendering {name}"
        monitor.report(stage, 0.3)
        render_scene(scene, plan.render)
    monitor.report(stage, 1.0)


def _each(source: Source, options: argparse.Namespace) -> bool:
    """Whether each object of a source becomes a Blender object; a result is one."""
    return bool(options.each) and not source.is_result


def _create_request(source: Source, options: argparse.Namespace) -> DecomposeRequest:
    """The request of the panel, so that the object can be edited and decomposed again there."""
    method = MethodSettings(
        options.model,
        options.separator,
        options.illumination,
        options.max_size,
        options.samples,
        options.camera,
        options.texture_size,
        options.highlight_odds,
        refine=options.refine,
        light_colour=options.light_colour,
    )
    build = BuildOptions(
        size_metres=options.size,
        sun=options.sun,
        displacement=options.displacement,
        back=options.back,
        triangles=options.triangles,
        own_shadows=True if options.own_shadows else None,
        specular_from=options.specular,
        name=source.name,
        each=_each(source, options),
    )
    photo = "" if source.is_result else _load_image(source.path, options.transfer)
    mask = "" if source.mask is None or not photo else _load_image(source.mask)
    return DecomposeRequest(image=photo, mask=mask, method=method, build=build)


def _load_image(path: Path, transfer: str = "auto") -> str:
    """The name of the packed image of a file, "" if Blender cannot read the file.

    The panel, and Update Object, take the transfer curve from the color space of the image.
    """
    try:
        image = bpy.data.images.load(str(path.resolve()), check_existing=True)
        if transfer in _COLOR_SPACES:
            image.colorspace_settings.name = _COLOR_SPACES[transfer]
        image.pack()
    except RuntimeError:
        return ""
    return str(image.name_full)


def open_empty_file() -> list[Any]:
    """Open an empty file; add-ons and preferences are unchanged.

    Returns
    -------
    list of bpy.types.Scene
        The scenes that Blender requires.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return list(bpy.data.scenes)


def save_blend(path: Path) -> None:
    """Save the file.

    Parameters
    ----------
    path : Path
        The .blend file.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), check_existing=False)
    except (OSError, RuntimeError) as error:
        raise InputError(f"cannot write {path}: {reason_line(error)}") from error


def render_scene(scene: Any, path: Path) -> None:
    """Render a scene.

    Parameters
    ----------
    scene : bpy.types.Scene
        The scene.
    path : Path
        .png (16 bits, with the scene's view transform) or .exr (32 bits, linear).

    Raises
    ------
    InputError
        If it cannot be rendered or written.
    """
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = _RENDER_FORMATS[path.suffix.lower()]
    settings.color_mode = "RGBA"
    scene.render.use_file_extension = False
    with new_file(path) as partial:
        scene.render.filepath = str(partial)
        try:
            bpy.ops.render.render(write_still=True, scene=scene.name)
        except RuntimeError as error:
            raise InputError(f"cannot render {path}: {reason_line(error)}") from error
        if not partial.is_file():
            raise InputError(f"cannot render {path}: Blender wrote no file")
