"""Build a result folder as an object in the scene, as one undo step."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from isc_core.errors import InputError

from ..files.result_arrays import ARRAYS, DESCRIPTION, read_result
from ..scene.build import BuiltObject, build_object, find_built
from ..settings.preferences import create_run_folder, read_preferences, worker_environment
from .modal import WorkerOperator
from .request import (
    DecomposeRequest,
    build_options,
    find_by_full_name,
    request_from_json,
    store_request,
)
from .run_steps import arrays_steps
from .worker_run import WorkerRun, require_no_active_run


def build_as_undo_step(context: Any, folder: Path, request: DecomposeRequest | None = None) -> str:
    """Build the result of a folder as one undo step.

    Parameters
    ----------
    context : bpy.types.Context
        Ignored: building changes the scene and the object that are active.
    folder : Path
        Result folder with arrays.
    request : DecomposeRequest, optional
        What to build; None uses the panel's settings.

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
    text = "" if request is None else request.to_json()
    try:
        # From Python, an operator pushes an undo step only if told to.
        bpy.ops.isc.build_result("EXEC_DEFAULT", True, directory=str(folder), request=text)
    except RuntimeError as error:
        raise InputError(str(error).strip().splitlines()[0].removeprefix("Error: ")) from error
    built = find_built(bpy.context.object)
    if built is None:
        return "the result is in the scene"
    return f"{built.object.name}: built in the scene {built.scene.name}"


class ISC_OT_build_result(bpy.types.Operator):
    """Build the object of a result folder."""

    bl_idname = "isc.build_result"
    bl_label = "Build Result"
    bl_description = (
        "Build the object of a result folder, or update the object built from the same photo"
    )
    bl_options = {"UNDO", "INTERNAL"}

    directory: StringProperty(
        name="Folder", description="Result folder with arrays.npz", subtype="DIR_PATH"
    )
    request: StringProperty(
        name="Request", description="Request as JSON, empty uses the panel's settings"
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
            result = read_result(Path(self.directory))
            scene = find_by_full_name(bpy.data.scenes, request.scene) or context.scene
            photo = find_by_full_name(bpy.data.images, request.image)
            built = build_object(result, request.build, scene=scene, photo=photo)
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        _complete(built, request, scene)
        _activate(context, built)
        return {"FINISHED"}


class ISC_OT_import_result(bpy.types.Operator):
    """Import a result folder of `isc decompose`."""

    bl_idname = "isc.import_result"
    bl_label = "Import Result"
    bl_description = "Build the object of a result folder of isc decompose"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder", description="Result folder of isc decompose", subtype="DIR_PATH"
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"}, description="Show folders")

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
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Build the object; a worker first adds missing arrays.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}, or {"CANCELLED"} after an error has been reported; the result of
            `ISC_OT_complete_result` where arrays are missing.
        """
        folder = Path(bpy.path.abspath(self.directory))
        if not self.directory or not (folder / DESCRIPTION).is_file():
            self.report(
                {"ERROR"}, f"{folder} is no result: select a folder that isc decompose has written"
            )
            return {"CANCELLED"}
        if not (folder / ARRAYS).is_file():
            return set(bpy.ops.isc.complete_result("INVOKE_DEFAULT", directory=str(folder)))
        try:
            self.report({"INFO"}, build_as_undo_step(context, folder))
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class ISC_OT_complete_result(WorkerOperator, bpy.types.Operator):
    """Add the arrays that Blender reads to a result folder, then build its object."""

    bl_idname = "isc.complete_result"
    bl_label = "Complete Result"
    bl_description = "Add arrays.npz to a result folder without it, and build its object"
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
        return WorkerRun(
            f"Import {folder.name}",
            arrays_steps(folder, environment),
            build_as_undo_step,
            create_run_folder(None, "import"),
        )


def _panel_request(scene: Any) -> DecomposeRequest:
    return DecomposeRequest(build=build_options(scene.isc, ""), scene=scene.name_full)


def _complete(built: BuiltObject, request: DecomposeRequest, scene: Any) -> None:
    """Store what the panels need later; the object's own scene also gets the settings."""
    store_request(built.object, request)
    if request.build.own_scene:
        if built.scene.render.engine == "CYCLES":
            built.scene.cycles.samples = request.method.samples
        if built.scene != scene:
            _copy_settings(scene.isc, built.scene.isc)


def _copy_settings(source: Any, target: Any) -> None:
    for name, prop in source.bl_rna.properties.items():
        if name not in {"rna_type", "name", "preset"} and not prop.is_readonly:
            setattr(target, name, getattr(source, name))


def _activate(context: Any, built: BuiltObject) -> None:
    """Make the object active; its own scene is shown through the photo's camera."""
    if context.window is not None and context.window.scene != built.scene:
        context.window.scene = built.scene
        for area in context.window.screen.areas:
            if area.type == "VIEW_3D":
                area.spaces.active.region_3d.view_perspective = "CAMERA"
    layer = built.scene.view_layers[0] if context.window is None else context.window.view_layer
    layer.update()  # so that it includes what was linked a moment ago
    if built.object.name not in layer.objects:
        return
    for other in list(layer.objects.selected):
        other.select_set(False, view_layer=layer)
    built.object.select_set(True, view_layer=layer)
    layer.objects.active = built.object
