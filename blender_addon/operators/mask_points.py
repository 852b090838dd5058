"""Masks found by the looks of the photo; clicks on the photo say what is meant."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from math import floor
from typing import Any

import bpy
from bpy.props import BoolProperty

from isc_core.errors import InputError

from .mask import can_cut, mask_run
from .modal import WorkerOperator
from .photo_canvas import PhotoCanvas, shown_photo
from .run_steps import auto_mask_steps
from .worker_run import WorkerRun, active_run, require_no_active_run


class ISC_OT_auto_mask(WorkerOperator, bpy.types.Operator):
    """Find the object and make it the mask."""

    bl_idname = "isc.auto_mask"
    bl_label = "Auto Mask"
    bl_description = "Create the mask by finding the object in the photo; points say which it is"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether there is a photo and no run is active.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
            Where False, the tooltip gives the reason.
        """
        return can_cut(cls, context)

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
            If no photo is selected, it cannot be used, a point is no point, or a run is active.
        """
        require_no_active_run()
        settings = context.scene.isc
        if settings.image is None:
            raise InputError("no photo is selected: open a file, or choose an image of this file")
        points, others = parse_points(settings.points), parse_points(settings.other_points)
        return mask_run(
            context,
            "Auto Mask",
            lambda photo, folder, environment: auto_mask_steps(
                photo, points, others, folder, environment
            ),
        )


class ISC_OT_mark_point(bpy.types.Operator):
    """Mark a point of the object or of the background with a click, and find the mask again."""

    bl_idname = "isc.mark_point"
    bl_label = "Add Point"
    bl_description = "Click on the object, or on what does not belong to it, and find the mask"

    background: BoolProperty(
        name="Background", description="The point does not belong to the object"
    )

    _size: tuple[int, ...] = (0, 0)
    _canvas: PhotoCanvas | None = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether there is a photo to click on and no run is active.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
            Where False for want of a photo, the tooltip gives the reason.
        """
        if shown_photo(context) is None:
            cls.poll_message_set("Open a photo first")
            return False
        return active_run() is None

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Wait for the mouse.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator; not used.

        Returns
        -------
        set of str
            {"RUNNING_MODAL"}.
        """
        del event
        settings, shown = context.scene.isc, shown_photo(context)
        if shown not in (settings.image, settings.mask):
            settings.image = shown
        context.window.cursor_modal_set("CROSSHAIR")
        context.workspace.status_text_set(
            "Click on the background" if self.background else "Click on the object"
        )
        self._size = tuple(shown.size)
        self._canvas = PhotoCanvas(context, shown)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Take the click of the left mouse button.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            Event of the mouse or keyboard; its position is in pixels of the window.

        Returns
        -------
        set of str
            {"PASS_THROUGH"} while waiting; {"FINISHED"} with a point; {"CANCELLED"} on Esc, the
            right mouse button, or a click beside the photo.
        """
        if event.type in {"ESC", "RIGHTMOUSE"}:
            return self._leave(context, {"CANCELLED"})
        if event.type != "LEFTMOUSE" or event.value != "PRESS" or self._canvas is None:
            return {"PASS_THROUGH"}
        position = self._canvas.position(event)
        if position is None:
            return self._leave(context, {"CANCELLED"})
        point = point_at(self._canvas.place(position), self._size)
        self._leave(context, set())
        if point is None:
            self.report({"WARNING"}, "the point lies outside of the photo: click on the photo")
            return {"CANCELLED"}
        settings = context.scene.isc
        name = "other_points" if self.background else "points"
        setattr(settings, name, f"{getattr(settings, name)} {point[0]},{point[1]}".strip())
        bpy.ops.isc.auto_mask("INVOKE_DEFAULT")
        return {"FINISHED"}

    def cancel(self, context: Any) -> None:
        """Stop waiting: Blender ends the operator.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        """
        self._leave(context, set())

    def _leave(self, context: Any, result: set[str]) -> set[str]:
        if self._canvas is not None:
            self._canvas.close()
            self._canvas = None
        if context.window is not None:  # another file is loaded
            context.window.cursor_modal_restore()
            context.workspace.status_text_set(None)
        return result


class ISC_OT_clear_points(bpy.types.Operator):
    """Remove all points."""

    bl_idname = "isc.clear_points"
    bl_label = "Clear Points"
    bl_description = "Remove the points of the object and of the background"
    bl_options = {"UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Remove the points.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}.
        """
        context.scene.isc.points = context.scene.isc.other_points = ""
        return {"FINISHED"}


def point_at(place: tuple[float, float], size: tuple[int, ...]) -> tuple[int, int] | None:
    """Convert a place in the image editor's view to a pixel.

    Parameters
    ----------
    place : tuple of float
        (0, 0) is the image's lower left corner, (1, 1) its upper right one.
    size : tuple of int
        Width and height of the image in pixels.

    Returns
    -------
    tuple of int or None
        Column and row from the upper left corner; None outside of the image.
    """
    x, y = floor(place[0] * size[0]), floor((1 - place[1]) * size[1])
    return (x, y) if 0 <= x < size[0] and 0 <= y < size[1] else None


def parse_points(text: str) -> list[tuple[int, int]]:
    """Read the points of a field of the panel.

    Parameters
    ----------
    text : str
        Such as "120,80 64,200".

    Returns
    -------
    list of (x, y)

    Raises
    ------
    InputError
        If a word is no point.
    """
    points = []
    for word in text.split():
        try:
            x, y = (int(part) for part in word.split(","))
        except ValueError as error:
            raise InputError(f"{word!r} is no point: write column,row, such as 120,80") from error
        points.append((x, y))
    return points
