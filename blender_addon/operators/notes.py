"""The notes on the last result, behind an icon."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from typing import Any

import bpy
from bpy.props import StringProperty


class ISC_OT_show_notes(bpy.types.Operator):
    """Show what to keep in mind about the last result."""

    bl_idname = "isc.show_notes"
    bl_label = "Notes on the Result"
    bl_description = "Show the notes on the last result"
    bl_options = {"INTERNAL"}

    notes: StringProperty(name="Notes", description="The notes, one per line")

    @classmethod
    def description(cls, context: Any, properties: Any) -> str:
        """Return the notes as tooltip.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context; not used.
        properties : bpy.types.OperatorProperties
            The notes.

        Returns
        -------
        str
        """
        del context
        return str(properties.notes) or cls.bl_description

    def execute(self, context: Any) -> set[str]:
        """Show the notes in a popup.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}.
        """
        lines = self.notes.splitlines()

        def draw(popup: Any, context: Any) -> None:
            del context
            for line in lines:
                popup.layout.label(text=line)

        context.window_manager.popup_menu(draw, title=self.bl_label, icon="ERROR")
        return {"FINISHED"}
