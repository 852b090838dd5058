"""Build a result folder as an object in the scene, as one undo step."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from isc_core.errors import InputError

from ..datablocks.provenance import find_tagged
from ..datablocks.staging import run_to_end
from ..files.result_arrays import DESCRIPTION
from ..runs.active_run import require_no_active_run
from ..runs.messages import error_line, sentence
from ..runs.request import (
    DecomposeRequest,
    build_options,
    find_by_full_name,
    request_from_json,
    store_request,
    track_names,
)
from ..runs.run_steps import import_steps, read_and_prepare
from ..runs.worker_run import ImportSteps, RunOutput, WorkerRun, remove_folder
from ..scene.build import StagedObject, key_of
from ..scene.built_object import BuiltObject, find_built
from ..scene.copies import OBJECT
from ..scene.objects import discard, place_objects, stage_objects
from ..settings.preferences import create_run_folder, read_preferences, worker_environment
from .modal import WorkerOperator
from .viewport import activate, invoking_view, show

# Staged objects by folder, until they are placed: operators take plain values only.
_staged: dict[str, list[StagedObject]] = {}
_CAME_FROM = "isc_came_from"
_SAMPLES = "isc_samples"  # of a scene: what was set last


def build_in_steps(
    context: Any, output: RunOutput, request: DecomposeRequest | None = None, view: int = 0
) -> ImportSteps:
    """Build the result of a folder in short steps, as one undo step, and show it.

    The scene is unchanged until the last step; if the steps are closed early, nothing is left.

    Parameters
    ----------
    context : bpy.types.Context
        Ignored: building changes the scene and the object that are active.
    output : RunOutput
        Result folder with arrays.
    request : DecomposeRequest, optional
        What to build; None uses the panel's settings.
    view : int, optional
        The 3D view to show it in, see `viewport.invoking_view`.

    Returns
    -------
    str
        Where the object is, one line.

    Raises
    ------
    InputError
        If the result cannot be built.
    """
    del context
    request = request or _panel_request(bpy.context.scene)
    folder, photo = str(output.path), find_by_full_name(bpy.data.images, request.image)
    prepared = output.prepared or read_and_prepare(
        output.path, request.build, with_photo=photo is None
    )
    _staged[folder] = yield from stage_objects(prepared, photo=photo)
    before = {obj.session_uid for obj in bpy.data.objects}
    try:
        # From Python, an operator pushes an undo step only if told to.
        bpy.ops.isc.build_result("EXEC_DEFAULT", True, directory=folder, request=request.to_json())
    except RuntimeError as error:
        raise InputError(error_line(error)) from error
    finally:
        discard(_staged.pop(folder))
    # It is not active if its collection is excluded.
    key = key_of(prepared[0], find_by_full_name(bpy.data.images, request.image))
    built = find_built(find_tagged(bpy.data.objects, key, OBJECT))
    if built is None:
        return "the object is in the scene"
    what = built.object.name if len(prepared) == 1 else f"{len(prepared)} objects"
    if built.object.session_uid in before:
        return f"{what} updated"
    show(bpy.context, built, request.build.own_scene, view)
    where = f"in the scene {built.scene.name}" if request.build.own_scene else "at the 3D cursor"
    return f"{what} created {where}"


def build_as_undo_step(
    context: Any, output: RunOutput, request: DecomposeRequest | None = None, view: int = 0
) -> str:
    """Build the result of a folder as one undo step and in one call, and show it.

    Parameters
    ----------
    context, output, request, view
        As of `build_in_steps`.

    Returns
    -------
    str
        Where the object is, one line.

    Raises
    ------
    InputError
        If the result cannot be built.
    """
    return run_to_end(build_in_steps(context, output, request, view))


class ISC_OT_build_result(bpy.types.Operator):
    """Build the object of a result folder."""

    bl_idname = "isc.build_result"
    bl_label = "Create Object from Result"
    bl_description = (
        "Create the object from a result folder, or update the object of the same photo"
    )
    bl_options = {"UNDO", "INTERNAL"}

    directory: StringProperty(
        name="Folder", description="Result folder with arrays.npz", subtype="DIR_PATH"
    )
    request: StringProperty(
        name="Request", description="Request as JSON; if empty, the panel's settings are used"
    )

    def execute(self, context: Any) -> set[str]:
        """Build the object; on an error the scene is unchanged.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}, or {"CANCELLED"} after an error has been reported.
        """
        try:
            request = (
                request_from_json(self.request) if self.request else _panel_request(context.scene)
            )
            scene = find_by_full_name(bpy.data.scenes, request.scene) or context.scene
            photo = find_by_full_name(bpy.data.images, request.image)
            active = context.object
            staged = _staged.get(self.directory)
            if staged is None:
                prepared = read_and_prepare(
                    Path(self.directory), request.build, with_photo=photo is None
                )
                staged = run_to_end(stage_objects(prepared, photo=photo))
            built = place_objects(staged, scene=scene, photo=photo)
        except InputError as error:
            self.report({"ERROR"}, sentence(str(error)))
            return {"CANCELLED"}
        for one in built:
            _store_settings(one, request, scene)
        # Of several objects that are updated, the active one stays so.
        activate(context, *sorted(built, key=lambda one: one.object != active))
        return {"FINISHED"}


class ISC_OT_import_result(bpy.types.Operator):
    """Import a result folder of `isc decompose`."""

    bl_idname = "isc.import_result"
    bl_label = "Import Result"
    bl_description = "Create an object from a result folder of isc decompose"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder", description="Result folder of isc decompose", subtype="DIR_PATH"
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"}, description="Show folders")
    _selected = False  # in the file browser

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Open the file browser.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator; not used.

        Returns
        -------
        set of str
            {"RUNNING_MODAL"}; Blender calls `execute` once a folder is selected.
        """
        del event
        self._selected = True
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Build the object.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context; not used.

        Returns
        -------
        set of str
            As of `ISC_OT_read_result`, which runs in the background if the folder was selected in
            the file browser; {"CANCELLED"} after an error has been reported.
        """
        del context
        folder = Path(bpy.path.abspath(self.directory))
        if not self.directory or not (folder / DESCRIPTION).is_file():
            self.report(
                {"ERROR"}, f"{folder} is not a result: select a folder written by isc decompose"
            )
            return {"CANCELLED"}
        try:
            how = "INVOKE_DEFAULT" if self._selected else "EXEC_DEFAULT"
            return set(bpy.ops.isc.read_result(how, directory=str(folder)))
        except RuntimeError as error:
            self.report({"ERROR"}, sentence(error_line(error)))
            return {"CANCELLED"}


class ISC_OT_read_result(WorkerOperator, bpy.types.Operator):
    """Read a result folder, and build its object."""

    bl_idname = "isc.read_result"
    bl_label = "Read Result"
    bl_description = "Read a result folder and create its object, in the background"
    bl_options = {"INTERNAL"}

    directory: StringProperty(name="Folder", description="Result folder", subtype="DIR_PATH")

    def prepare(self, context: Any) -> WorkerRun:
        """Create the run; see `WorkerOperator`.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        WorkerRun
            The run, not started.

        Raises
        ------
        InputError
            If a run is active, the worker's modules are missing, or no folder can be created.
        """
        require_no_active_run()
        folder = Path(self.directory)
        environment = worker_environment(read_preferences(context))
        view, request = invoking_view(context), _panel_request(context.scene)
        own, renamed = create_run_folder(None, "import"), track_names(request)

        def finish(context: Any, output: RunOutput) -> ImportSteps:
            message = yield from build_in_steps(context, output, renamed(), view)
            remove_folder(own)
            return message

        steps = import_steps(folder, request.build, environment)
        return WorkerRun(f"Import {folder.name}", steps, finish, own)


class ISC_OT_return_to_scene(bpy.types.Operator):
    """Show the scene again that an object's own scene was created from."""

    bl_idname = "isc.return_to_scene"
    bl_label = "Back to Scene"
    bl_description = "Return to the scene in which Create Object was pressed; this scene is kept"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether the scene is an object's own and the other one still exists.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
        """
        return context.window is not None and scene_before(context.scene) is not None

    def execute(self, context: Any) -> set[str]:
        """Show the other scene.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}.
        """
        context.window.scene = scene_before(context.scene)
        return {"FINISHED"}


def scene_before(scene: Any) -> Any:
    """Return the scene from which an object's own scene was created.

    Parameters
    ----------
    scene : bpy.types.Scene
        Any scene.

    Returns
    -------
    bpy.types.Scene or None
        None for other scenes, and where it was deleted.
    """
    return scene.get(_CAME_FROM)


def _panel_request(scene: Any) -> DecomposeRequest:
    # a folder holds one result, whatever the panel would do with a photo
    build = replace(build_options(scene.isc, ""), each=False)
    return DecomposeRequest(build=build, scene=scene.name_full)


def _store_settings(built: BuiltObject, request: DecomposeRequest, scene: Any) -> None:
    """Store what the panels need later; the object's own scene also gets the settings."""
    store_request(built.object, request)
    photo = find_by_full_name(bpy.data.images, request.image)
    if photo is not None and photo.packed_file is None and not photo.is_dirty:
        with suppress(RuntimeError):  # its file is gone
            photo.pack()
    if request.build.own_scene:
        if built.scene.render.engine == "CYCLES":
            _set_samples(built.scene, request.method.samples)
        if built.scene != scene:
            built.scene[_CAME_FROM] = scene
            _copy_settings(scene.isc, built.scene.isc)


def _set_samples(scene: Any, samples: int) -> None:
    """Set the samples of a scene, unless the user has changed them since."""
    if scene.get(_SAMPLES, scene.cycles.samples) == scene.cycles.samples:
        scene.cycles.samples = scene[_SAMPLES] = samples


def _copy_settings(source: Any, target: Any) -> None:
    for name, prop in source.bl_rna.properties.items():
        if name not in {"rna_type", "name", "preset"} and not prop.is_readonly:
            setattr(target, name, getattr(source, name))
