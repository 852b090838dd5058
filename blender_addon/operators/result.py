"""A result's folder becomes an object in the scene: as one undo step, whoever asks for it."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender wants its options as sets)

from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty

from isc_core.errors import InputError

from ..files.result_arrays import ARRAYS, read_result
from ..scene.build import Built, build, find
from ..settings.preferences import choices, new_folder, worker_environment
from .modal import WorkerOperator
from .request import Request, build_options, named, remember, request_from_json
from .run_steps import complete
from .worker_run import Run, require_idle


def build_in_one_step(context: Any, folder: Path, request: Request | None = None) -> str:
    """Builds the result in `folder` and makes one undo step of it; a line that says where it
    stands. Raises `InputError`.

    `request`: what was asked for; None takes the panel's choices.
    """
    del context
    text = "" if request is None else request.to_json()
    try:
        # Called from Python, an operator makes an undo step only if it is told to.
        bpy.ops.isc.build_result("EXEC_DEFAULT", True, directory=str(folder), request=text)
    except RuntimeError as error:
        raise InputError(str(error).strip().splitlines()[0].removeprefix("Error: ")) from error
    built = find(bpy.context.object)
    return (
        "the result is in the scene"
        if built is None
        else f"{built.object.name}: built in the scene {built.scene.name}"
    )


class ISC_OT_build_result(bpy.types.Operator):
    """Builds what a result's folder holds."""

    bl_idname = "isc.build_result"
    bl_label = "Build Result"
    bl_description = "Build the object of a result's folder, or update the one that was built from the same photo"
    bl_options = {"UNDO", "INTERNAL"}

    directory: StringProperty(
        name="Folder", description="The result's folder, arrays.npz in it", subtype="DIR_PATH"
    )
    request: StringProperty(
        name="Request", description="What was asked for, as JSON; empty: what the panel says"
    )

    def execute(self, context: Any) -> set[str]:
        """Builds it; the scene is as before if it cannot be."""
        try:
            request = (
                request_from_json(self.request) if self.request else _asked_by_panel(context.scene)
            )
            result = read_result(Path(self.directory))
            scene = named(bpy.data.scenes, request.scene) or context.scene
            built = build(
                result, request.build, scene=scene, photo=named(bpy.data.images, request.image)
            )
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        _complete(built, request, scene)
        _show(context, built)
        return {"FINISHED"}


class ISC_OT_import_result(bpy.types.Operator):
    """Imports a folder that `isc decompose` wrote."""

    bl_idname = "isc.import_result"
    bl_label = "Import Result"
    bl_description = "Build the object of a folder that isc decompose wrote"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder", description="The folder that isc decompose wrote", subtype="DIR_PATH"
    )
    filter_folder: bpy.props.BoolProperty(
        default=True, options={"HIDDEN"}, description="Show folders"
    )

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Asks for the folder."""
        del event
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Builds it; a folder without arrays is given them first, by a worker."""
        folder = Path(bpy.path.abspath(self.directory))
        if not self.directory or not (folder / "decomposition.json").is_file():
            self.report(
                {"ERROR"}, f"{folder} is no result: give the folder that isc decompose wrote"
            )
            return {"CANCELLED"}
        if not (folder / ARRAYS).is_file():
            return set(bpy.ops.isc.complete_result("INVOKE_DEFAULT", directory=str(folder)))
        try:
            self.report({"INFO"}, build_in_one_step(context, folder))
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class ISC_OT_complete_result(WorkerOperator, bpy.types.Operator):
    """Gives a result the arrays that Blender reads, then builds it."""

    bl_idname = "isc.complete_result"
    bl_label = "Complete Result"
    bl_description = "Write arrays.npz into a result's folder that has none, and build its object"
    bl_options = {"INTERNAL"}

    directory: StringProperty(name="Folder", description="The result's folder", subtype="DIR_PATH")

    def prepare(self, context: Any) -> Run:
        """The run. Raises `InputError`."""
        require_idle()
        folder = Path(self.directory)
        environment = worker_environment(choices(context))
        return Run(
            f"Import {folder.name}",
            complete(folder, environment),
            build_in_one_step,
            new_folder(None, "import"),
        )


def _asked_by_panel(scene: Any) -> Request:
    return Request(build=build_options(scene.isc, ""), scene=scene.name_full)


def _complete(built: Built, request: Request, scene: Any) -> None:
    """What the panels need later: how the object was made, and the choices in its own scene too."""
    remember(built.object, request)
    if request.build.own_scene:
        if built.scene.render.engine == "CYCLES":
            built.scene.cycles.samples = request.method.samples
        if built.scene != scene:
            _copy_settings(scene.isc, built.scene.isc)


def _copy_settings(source: Any, target: Any) -> None:
    for name, about in source.bl_rna.properties.items():
        if name not in {"rna_type", "name", "preset"} and not about.is_readonly:
            setattr(target, name, getattr(source, name))


def _show(context: Any, built: Built) -> None:
    """Makes the object the active one, where the user looks; its own scene is looked at through the
    photo's camera.
    """
    if context.window is not None and context.window.scene != built.scene:
        context.window.scene = built.scene
        for area in context.window.screen.areas:
            if area.type == "VIEW_3D":
                area.spaces.active.region_3d.view_perspective = "CAMERA"
    layer = built.scene.view_layers[0] if context.window is None else context.window.view_layer
    layer.update()  # it does not know yet what was linked just now
    if built.object.name not in layer.objects:
        return
    for other in list(layer.objects.selected):
        other.select_set(False, view_layer=layer)
    built.object.select_set(True, view_layer=layer)
    layer.objects.active = built.object
