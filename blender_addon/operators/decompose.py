"""Create the object of the panel's photo, or create an object again at another size."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from collections.abc import Iterator
from typing import Any

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from isc_core.errors import InputError
from isc_core.result_files.object_folders import object_folders

from ..datablocks.provenance import KEY, find_tagged
from ..files.result_arrays import ARRAYS
from ..runs.active_run import poll_idle, require_no_active_run
from ..runs.messages import sentence
from ..runs.request import (
    DecomposeRequest,
    inspect_images,
    request_from_settings,
    stored_request,
    track_names,
)
from ..runs.run_steps import ResultDestination, decompose_steps
from ..runs.worker_run import ImportSteps, RunOutput, WorkerRun, remove_folder
from ..scene.copies import OBJECT, find_original, is_copy
from ..scene.hand_edits import is_edited_by_hand
from ..settings.preferences import create_run_folder, read_preferences, worker_environment
from .edit import NeedsObject, require_built
from .modal import NeedsPhoto, WorkerOperator, start_operator
from .result import build_in_steps
from .viewport import invoking_view


def create_decompose_run(context: Any, request: DecomposeRequest) -> WorkerRun:
    """Create the run that recovers the object of a photo and builds it.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.
    request : DecomposeRequest
        What to decompose and to build.

    Returns
    -------
    WorkerRun
        The run, not started.

    Raises
    ------
    InputError
        If the request cannot be fulfilled.
    """
    require_no_active_run()
    photo, mask, mask_size = inspect_images(request)
    preferences = read_preferences(context)
    environment = worker_environment(preferences)
    folder = create_run_folder(preferences.results, request.build.name)
    keep, with_photo = preferences.results is not None, not request.image
    place = ResultDestination(folder, preferences.earlier, keep, request.build, with_photo)
    steps = decompose_steps(
        photo, mask, mask_size, request.method, place, preferences.threads, environment
    )
    view, renamed = invoking_view(context), track_names(request)

    def finish(context: Any, output: RunOutput) -> ImportSteps:
        message = yield from build_in_steps(context, output, renamed(), view)
        if output.remark:
            message = f"{message}; {output.remark}"
        if output.path.is_relative_to(folder):
            # By far the largest files; the scene holds their content now.
            for result in (output.path, *object_folders(output.path)):
                (result / ARRAYS).unlink(missing_ok=True)
        else:
            remove_folder(folder)
        return message

    return WorkerRun(f"Create {request.build.name}", steps, finish, folder)


class _OverwriteMixin(WorkerOperator):
    """Mixin for operators that replace the mesh of an object: they ask before they overwrite one
    that was edited by hand.
    """

    bl_idname: str

    overwrite: BoolProperty(
        name="Overwrite Edits",
        description="Replace the mesh, even if it was edited by hand",
        default=False,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start the run, or ask first; see `WorkerOperator`.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator.

        Returns
        -------
        set of str
            {"CANCELLED"} where a dialog asks; it starts the operator again.
        """
        try:
            edited = None if self.overwrite else _edited_object(self.request(context))
        except InputError as error:
            self.report({"ERROR"}, sentence(str(error)))
            return {"CANCELLED"}
        if edited is None or bpy.app.background or context.window is None:
            return super().invoke(context, event)
        bpy.ops.isc.confirm_overwrite(
            "INVOKE_DEFAULT",
            again=self.bl_idname,
            edited=edited.name,
            max_size=getattr(self, "max_size", 0),
        )
        return {"CANCELLED"}

    def request(self, context: Any) -> DecomposeRequest:
        """Return what is created.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        DecomposeRequest
            The request.

        Raises
        ------
        InputError
            If there is nothing to create.
        """
        raise NotImplementedError

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
            If the settings are incomplete, the request cannot be fulfilled, the mesh was edited by
            hand, or a run is active.
        """
        request = self.request(context)
        edited = _edited_object(request)
        if edited is not None and not self.overwrite:
            raise InputError(
                f"the mesh of {edited.name} was edited by hand: enable Overwrite Edits, or "
                "duplicate the object and delete this one"
            )
        return create_decompose_run(context, request)


def _edited_object(request: DecomposeRequest) -> Any:
    """An object that a request would update, if its mesh was edited by hand; else None."""
    return next((obj for obj in _updated_objects(request) if is_edited_by_hand(obj)), None)


def _updated_objects(request: DecomposeRequest) -> Iterator[Any]:
    keys = [request.build.name]
    if request.build.each:
        start = f"{request.build.name} "
        made = {str(obj.get(KEY, "")) for obj in bpy.data.objects}
        keys = sorted(
            key for key in made if key.startswith(start) and key.removeprefix(start).isdecimal()
        )
    found = (find_tagged(bpy.data.objects, key, OBJECT) for key in keys)
    return (obj for obj in found if obj is not None)


class ISC_OT_confirm_overwrite(bpy.types.Operator):
    """Ask before an edited mesh is replaced."""

    bl_idname = "isc.confirm_overwrite"
    bl_label = "Overwrite"
    bl_description = "Replace the edited mesh by the mesh that is created from the photo"
    bl_options = {"INTERNAL"}

    again: StringProperty(name="Operator", description="Operator to start on confirmation")
    edited: StringProperty(name="Object", description="Name of the edited object")
    max_size: IntProperty(name="Size", description="Size at which to update the object", min=0)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator.

        Returns
        -------
        set of str
            As Blender's dialog, which calls `execute` on confirmation.
        """
        return set(
            context.window_manager.invoke_confirm(
                self,
                event,
                title="Overwrite Edited Mesh?",
                message=f"The mesh of {self.edited} was edited by hand. These edits will be lost.",
                confirm_text="Overwrite",
                icon="WARNING",
            )
        )

    def execute(self, context: Any) -> set[str]:
        """Start the operator again.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context; not used.

        Returns
        -------
        set of str
            {"FINISHED"}.
        """
        del context
        if self.again == ISC_OT_redo.bl_idname:
            start_operator(self, bpy.ops.isc.redo, overwrite=True, max_size=self.max_size)
        else:
            start_operator(self, bpy.ops.isc.decompose, overwrite=True)
        return {"FINISHED"}


class ISC_OT_decompose(NeedsPhoto, _OverwriteMixin, bpy.types.Operator):
    """Create the object of the panel's photo."""

    bl_idname = "isc.decompose"
    bl_label = "Create Object"
    bl_description = (
        "Recover shape, material and light of the object in the photo and add it to the scene, "
        "in the background"
    )

    def request(self, context: Any) -> DecomposeRequest:
        """Return the request of the scene's panel; see `_OverwriteMixin`.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        DecomposeRequest
            The request.

        Raises
        ------
        InputError
            If the panel's settings are incomplete.
        """
        return request_from_settings(context.scene)


class ISC_OT_redo(NeedsObject, _OverwriteMixin, bpy.types.Operator):
    """Create an object again from its photo, at another size."""

    bl_idname = "isc.redo"
    bl_label = "Update Object"
    bl_description = (
        "Create the active object again from its photo, at another size; color edits are kept"
    )
    bl_options = {"REGISTER"}

    max_size: IntProperty(
        name="Size",
        description=(
            "Longer side of the object in its maps, in pixels (0 keeps the photo's resolution)"
        ),
        default=512,
        min=0,
        max=8192,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether an ISC object is active and no run is.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
            Where False, the tooltip gives the reason.
        """
        return super().poll(context) and poll_idle(cls)

    def request(self, context: Any) -> DecomposeRequest:
        """Return the request that made the active object; see `_OverwriteMixin`.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        DecomposeRequest
            The request.

        Raises
        ------
        InputError
            If no ISC object is active, the active one is a copy, or it stores no request.
        """
        built = require_built(context)
        if is_copy(built.object):
            original = find_original(built.object)
            instead = "press Create Object" if original is None else f"select {original.name}"
            raise InputError(
                f"{built.object.name} is a copy, and only the original is updated: {instead}"
            )
        return stored_request(built.object, built.scene, self.max_size)
