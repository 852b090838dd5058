"""Save an object as an asset into one of the user's asset libraries."""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from isc_core.errors import InputError

from ..runs.messages import sentence
from ..scene.asset import save_asset
from .edit import NeedsObject, require_built


class ISC_OT_save_asset(NeedsObject, bpy.types.Operator):
    """Save the active object as an asset."""

    bl_idname = "isc.save_asset"
    bl_label = "Save as Asset"
    bl_description = (
        "Mark the object and its material as assets, render their preview from the photo's view, "
        "and save them into an asset library"
    )
    bl_options = {"REGISTER", "UNDO"}

    library: StringProperty(
        name="Library",
        description="Asset library to save into; if empty, the first in the preferences",
        options={"SKIP_SAVE"},
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Replace an asset of the same name instead of numbering the new one",
        default=False,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the library.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator; not used.

        Returns
        -------
        set of str
            {"RUNNING_MODAL"}; Blender calls `execute` on confirmation.
        """
        del event
        libraries = context.preferences.filepaths.asset_libraries
        self.library = libraries[0].name if len(libraries) else ""
        return set(context.window_manager.invoke_props_dialog(self, confirm_text="Save"))

    def draw(self, context: Any) -> None:
        """Draw the dialog.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        """
        layout = self.layout
        layout.use_property_split = True
        paths = context.preferences.filepaths
        layout.prop_search(self, "library", paths, "asset_libraries")
        layout.prop(self, "overwrite")

    def execute(self, context: Any) -> set[str]:
        """Save the object.

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
            built = require_built(context)
            path = save_asset(built, library_folder(context, self.library), self.overwrite)
        except InputError as error:
            self.report({"ERROR"}, sentence(str(error)))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{built.object.name} saved in {path}")
        return {"FINISHED"}


def library_folder(context: Any, name: str) -> Path:
    """Return the folder of an asset library.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.
    name : str
        Name of the library in the preferences; "" for the first one.

    Returns
    -------
    Path
        Its folder.

    Raises
    ------
    InputError
        If there is no such library.
    """
    libraries = context.preferences.filepaths.asset_libraries
    found = next((library for library in libraries if not name or library.name == name), None)
    if found is None or not found.path:
        raise InputError(
            "there is no such asset library: add one in Preferences > File Paths > Asset Libraries"
        )
    return Path(bpy.path.abspath(found.path))
