"""Decompose the photo of the panel, or the photo of an object again at another size."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from pathlib import Path
from typing import Any

import bpy
from bpy.props import IntProperty

from isc_core.errors import InputError

from ..files.result_arrays import ARRAYS
from ..scene.build import find_built
from ..scene.copies import find_original, is_copy
from ..settings.preferences import create_run_folder, read_preferences, worker_environment
from .messages import busy_message
from .modal import WorkerOperator
from .request import DecomposeRequest, inspect_images, request_from_settings, stored_request
from .result import build_as_undo_step
from .run_steps import decompose_steps
from .worker_run import WorkerRun, active_run, require_no_active_run


def create_decompose_run(context: Any, request: DecomposeRequest) -> WorkerRun:
    """Create the run that decomposes a photo and builds the result.

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
    steps = decompose_steps(
        photo, mask, mask_size, request.method, folder, preferences.threads, environment
    )

    def finish(context: Any, result: Path) -> str:
        message = build_as_undo_step(context, result, request)
        # By far the largest file; the scene holds its content now.
        (result / ARRAYS).unlink(missing_ok=True)
        return message

    return WorkerRun(f"Decompose {request.build.name}", steps, finish, folder)


class ISC_OT_decompose(WorkerOperator, bpy.types.Operator):
    """Decompose the photo of the panel."""

    bl_idname = "isc.decompose"
    bl_label = "Decompose"
    bl_description = (
        "Recover shape, light and material of the object in the photo and build it, "
        "in the background"
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether no run is active.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context; not used.

        Returns
        -------
        bool
            False while a run is active; the tooltip then names it.
        """
        del context
        return _is_idle(cls)

    def prepare(self, context: Any) -> WorkerRun:
        """Create the run of the scene's panel; see `WorkerOperator`.

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
            If the panel's settings are incomplete, the request cannot be fulfilled, or a run is
            active.
        """
        return create_decompose_run(context, request_from_settings(context.scene))


class ISC_OT_redo(WorkerOperator, bpy.types.Operator):
    """Decompose an object's photo again at another size, and update the object."""

    bl_idname = "isc.redo"
    bl_label = "Decompose Again"
    bl_description = (
        "Decompose the photo of the active object at another size and update the object, "
        "color edits are kept"
    )
    bl_options = {"REGISTER"}

    max_size: IntProperty(
        name="Size",
        description=(
            "Longer side of the object in pixels, in maps and mesh, 0 keeps the photo's resolution"
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
        if find_built(context.object) is None:
            cls.poll_message_set("Select an object made by ISC")
            return False
        return _is_idle(cls)

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
            If no ISC object is active, the active one is a copy, the request cannot be fulfilled,
            or a run is active.
        """
        built = find_built(context.object)
        if built is None:
            raise InputError("no object made by ISC is active: select one")
        if is_copy(built.object):
            original = find_original(built.object)
            instead = "press Decompose" if original is None else f"select {original.name}"
            raise InputError(
                f"{built.object.name} is a copy, and only the original is updated: {instead}"
            )
        return create_decompose_run(
            context, stored_request(built.object, built.scene, self.max_size)
        )


def _is_idle(operator: Any) -> bool:
    present = active_run()
    if present is not None:
        operator.poll_message_set(busy_message(present.title))
    return present is None
