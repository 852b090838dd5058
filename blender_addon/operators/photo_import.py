"""From a file, a dropped photo or the image of an editor to an object: File > Import, Add > Mesh,
Image, drag and drop.

A photo with transparency is created at once. The mask of any other is found first, and shown: the
user accepts it with Create Object, or corrects it.

Limits: transparency is inferred from the number of bits per pixel, not from the pixels.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

import contextlib
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from isc_core.errors import InputError

from ..runs.active_run import poll_idle
from ..runs.messages import sentence
from ..runs.request import find_by_full_name
from .modal import start_operator

SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".exr", ".hdr", ".webp", ".tga")
_EDITORS = {"VIEW_3D", "IMAGE_EDITOR"}
_BITS_WITH_ALPHA = {32, 64, 128}
_CATEGORY = "ISC"


class ISC_OT_photo_as_object(bpy.types.Operator):
    """Create an object of a photo."""

    bl_idname = "isc.photo_as_object"
    bl_label = "Photo as 3D Object"
    bl_description = (
        "Create a mesh with material from a photo of an object; the mask is found if the photo "
        "has no transparency"
    )
    bl_options = {"UNDO"}

    filepath: StringProperty(
        name="Photo",
        description="File of the photo",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    image: StringProperty(
        name="Image",
        description="Full name of an image in this .blend file, instead of a file",
        options={"SKIP_SAVE", "HIDDEN"},
    )
    filter_image: BoolProperty(default=True, options={"HIDDEN"}, description="Show images")
    filter_folder: BoolProperty(default=True, options={"HIDDEN"}, description="Show folders")

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
        return poll_idle(cls)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Open the file browser, unless a photo is given.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator; not used.

        Returns
        -------
        set of str
            {"RUNNING_MODAL"}, or as `execute`.
        """
        del event
        if self.filepath or self.image:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Make the photo that of the panel, and start to find its mask or to create its object.

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
            photo = self._photo()
        except InputError as error:
            self.report({"ERROR"}, sentence(str(error)))
            return {"CANCELLED"}
        settings = context.scene.isc
        settings.image, settings.mask, settings.mask_source = photo, None, "ALPHA"
        _show_panel(context.area)
        start = bpy.ops.isc.decompose if _has_alpha(photo) else bpy.ops.isc.auto_mask
        start_operator(self, start)
        return {"FINISHED"}

    def _photo(self) -> Any:
        if self.image:
            found = find_by_full_name(bpy.data.images, self.image)
            if found is None:
                raise InputError(
                    f"the image {self.image} is no longer in this file: choose another"
                )
            return found
        return load_photo(Path(bpy.path.abspath(self.filepath)))


def load_photo(path: Path) -> Any:
    """Load a photo, or find the image of that file; it gets the file's present content.

    An image that was painted on and not saved stays as it is.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bpy.types.Image
        The photo.

    Raises
    ------
    InputError
        If Blender cannot read the file as an image; nothing is left of it then.
    """
    before = set(bpy.data.images)
    try:
        image = bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError as error:
        raise InputError(_no_photo(path)) from error
    if image in before and image.library is None and not image.is_dirty:
        _reload_changed(image, path)
    if 0 in tuple(image.size):
        if image not in before:
            bpy.data.images.remove(image)
        raise InputError(_no_photo(path))
    return image


def _reload_changed(image: Any, path: Path) -> None:
    """Read the file of an image again; a packed one only if the file is another photo now."""
    if image.packed_file is not None:
        if not path.is_file() or path.read_bytes() == image.packed_file.data:
            return
        other = bpy.data.images.load(str(path))
        readable = 0 not in tuple(other.size)
        bpy.data.images.remove(other)
        if not readable:  # reading it would lose the packed photo
            raise InputError(_no_photo(path))
    image.reload()


def _no_photo(path: Path) -> str:
    return f"{path.name} is not a photo that Blender can read: use a JPEG, PNG, TIFF or EXR file"


def _has_alpha(image: Any) -> bool:
    return image.alpha_mode != "NONE" and image.depth in _BITS_WITH_ALPHA


def _show_panel(area: Any) -> None:
    """Open the sidebar at the tab of the panels."""
    if area is None or area.type not in _EDITORS:
        return
    area.spaces.active.show_region_ui = True
    sidebar = next((region for region in area.regions if region.type == "UI"), None)
    if sidebar is not None:
        with contextlib.suppress(AttributeError, TypeError):  # not drawn yet, or an older Blender
            sidebar.active_panel_category = _CATEGORY


class ISC_FH_photo(bpy.types.FileHandler):
    """Drag and drop of a photo onto the 3D view or the image editor."""

    bl_idname = "ISC_FH_photo"
    bl_label = "Photo as 3D Object"
    bl_import_operator = ISC_OT_photo_as_object.bl_idname
    bl_file_extensions = ";".join(SUFFIXES)

    @classmethod
    def poll_drop(cls, context: Any) -> bool:
        """Return whether a photo may be dropped here.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
        """
        return context.area is not None and context.area.type in _EDITORS
