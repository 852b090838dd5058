"""The main button: the photo of the panel becomes an object; and the same once more for an object
that is there, at another size.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender wants its options as sets)

from pathlib import Path
from typing import Any

import bpy
from bpy.props import IntProperty

from isc_core.errors import InputError

from ..files.result_arrays import ARRAYS
from ..scene.build import find
from ..scene.copies import is_copy, original_of
from ..settings.preferences import choices, new_folder, worker_environment
from .modal import WorkerOperator
from .request import Request, pictures_of, remembered, request_from_settings
from .result import build_in_one_step
from .run_steps import decompose
from .worker_run import Run, active, require_idle


def run_of(context: Any, request: Request) -> Run:
    """The run that decomposes the request's photo and builds the result.

    Raises `InputError` before anything is begun.
    """
    require_idle()
    photo, mask, mask_size = pictures_of(request)
    chosen = choices(context)
    environment = worker_environment(chosen)
    folder = new_folder(chosen.results, request.build.name)
    script = decompose(photo, mask, mask_size, request.method, folder, chosen.threads, environment)

    def finish(now: Any, result: Path) -> str:
        said = build_in_one_step(now, result, request)
        (result / ARRAYS).unlink(
            missing_ok=True
        )  # by far the largest file; what it holds is in the scene now
        return said

    return Run(f"Decompose {request.build.name}", script, finish, folder)


class ISC_OT_decompose(WorkerOperator, bpy.types.Operator):
    """Decomposes the photo of the panel."""

    bl_idname = "isc.decompose"
    bl_label = "Decompose"
    bl_description = "Recover shape, light and material of the object in the photo, and build it; the window stays free meanwhile"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Always but while a run goes on."""
        return _is_free(cls)

    def prepare(self, context: Any) -> Run:
        """The run of the scene's panel. Raises `InputError`."""
        return run_of(context, request_from_settings(context.scene))


class ISC_OT_redo(WorkerOperator, bpy.types.Operator):
    """Decomposes an object's photo again at another size, and updates the object."""

    bl_idname = "isc.redo"
    bl_label = "Decompose Again"
    bl_description = "Decompose the photo of the active object again, at another size, and update the object; colours that were set stay"
    bl_options = {"REGISTER"}

    max_size: IntProperty(
        name="Size",
        description="The object's long side in pixels, in the maps and the mesh; 0 keeps the photo's",
        default=512,
        min=0,
        max=8192,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """With an object of ISC active, while no run goes on."""
        if find(context.object) is None:
            cls.poll_message_set("Choose an object that ISC made")
            return False
        return _is_free(cls)

    def prepare(self, context: Any) -> Run:
        """The run. Raises `InputError`."""
        built = find(context.object)
        if built is None:
            raise InputError("choose an object that ISC made")
        if is_copy(built.object):
            original = original_of(built.object)
            instead = "press Decompose" if original is None else f"choose {original.name}"
            raise InputError(
                f"{built.object.name} is a copy, and only the original is updated: {instead}"
            )
        return run_of(context, remembered(built.object, built.scene, self.max_size))


def _is_free(operator: Any) -> bool:
    present = active()
    if present is not None:
        operator.poll_message_set(f"{present.title} is going on: wait for it, or cancel it first")
    return present is None
