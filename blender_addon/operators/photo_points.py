"""Points of the photo: on the object, for its mask, and on highlights, for the next run."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from collections.abc import Sequence
from typing import Any

import bpy
from bpy.props import BoolProperty

from ..runs.active_run import require_no_active_run
from ..runs.request import parse_points, require_photo
from ..runs.run_steps import auto_mask_steps
from ..runs.worker_run import WorkerRun
from .mask import mask_run
from .modal import NeedsPhoto, WorkerOperator, start_operator
from .photo_operators import ClickOnPhoto, StrokeOnPhoto


class ISC_OT_auto_mask(NeedsPhoto, WorkerOperator, bpy.types.Operator):
    """Find the object and make it the mask."""

    bl_idname = "isc.auto_mask"
    bl_label = "Auto Mask"
    bl_description = "Find the object in the photo and make it the mask; points select the object"

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
            If no photo is selected, photo or points cannot be used, or a run is active.
        """
        require_no_active_run()
        settings = context.scene.isc
        require_photo(settings)
        points, others = parse_points(settings.points), parse_points(settings.other_points)
        return mask_run(
            context,
            "Auto Mask",
            lambda photo, folder, environment: auto_mask_steps(
                photo, points, others, folder, environment
            ),
        )


class ISC_OT_mark_point(StrokeOnPhoto, bpy.types.Operator):
    """Mark the object or the background with a click or a stroke, and find the mask again."""

    bl_idname = "isc.mark_point"
    bl_label = "Add Point"
    bl_description = (
        "Find the mask again with a click on the object or on the background, or a stroke over it"
    )

    background: BoolProperty(
        name="Background", description="Mark a point that does not belong to the object"
    )

    def status_text(self) -> str:
        """Return what to mark; see `StrokeOnPhoto`.

        Returns
        -------
        str
        """
        what = "background" if self.background else "object"
        return f"Click on the {what} or draw a stroke over it, Esc or right mouse button to cancel"

    def use_points(self, settings: Any, points: Sequence[str]) -> None:
        """Add the points, and find the mask again; see `StrokeOnPhoto`.

        Parameters
        ----------
        settings : ISC_PG_settings
            Changed in place.
        points : sequence of str
            Columns and rows.
        """
        for point in points:
            _add_point(settings, "other_points" if self.background else "points", point)
        start_operator(self, bpy.ops.isc.auto_mask)


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


class ISC_OT_mark_highlight(ClickOnPhoto, bpy.types.Operator):
    """Mark a highlight, or print that looks like one, with a click."""

    bl_idname = "isc.mark_highlight"
    bl_label = "Mark as Highlight"
    bl_description = (
        "Mark a highlight that stayed in the base color, or print that was removed as a "
        "highlight, with a click on the photo. Create the object again afterwards"
    )
    bl_options = {"UNDO"}

    reject: BoolProperty(name="Print", description="Mark print or paint instead of a highlight")

    def status_text(self) -> str:
        """Return what to click on; see `ClickOnPhoto`.

        Returns
        -------
        str
        """
        what = "print or paint" if self.reject else "a highlight"
        return f"Click on {what}, Esc or right mouse button to cancel"

    def use_point(self, settings: Any, point: str) -> None:
        """Add the mark; see `ClickOnPhoto`.

        Parameters
        ----------
        settings : ISC_PG_settings
            Changed in place.
        point : str
            Column and row.
        """
        _add_point(settings, "not_highlights" if self.reject else "highlights", point)


class ISC_OT_clear_highlights(bpy.types.Operator):
    """Remove all marks of highlights."""

    bl_idname = "isc.clear_highlights"
    bl_label = "Clear Marks"
    bl_description = "Remove all marks; highlights are then detected automatically"
    bl_options = {"UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Remove the marks.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}.
        """
        context.scene.isc.highlights = context.scene.isc.not_highlights = ""
        return {"FINISHED"}


def _add_point(settings: Any, name: str, point: str) -> None:
    """Append a point, column and row, to a field of the panel."""
    setattr(settings, name, f"{getattr(settings, name)} {point}".strip())
