"""Entries in Blender's menus. Its search (F3) finds what is in a menu, so the operators on objects
are also in Object > ISC.
"""
# mypy: allow-subclassing-any

from typing import Any

import bpy

_PHOTO = "isc.photo_as_object"


class ISC_MT_object(bpy.types.Menu):
    """The operators of the panels, for the search."""

    bl_idname = "ISC_MT_object"
    bl_label = "ISC"

    def draw(self, context: Any) -> None:
        """Draw the entries.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context; not used.
        """
        del context
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator(_PHOTO, text="ISC: Photo as 3D Object...")
        layout.separator()
        for name, text in (
            ("isc.redo", "ISC: Update Object"),
            ("isc.recolour", "ISC: Recolor"),
            ("isc.dichromatic", "ISC: Diffuse and Specular Gain"),
            ("isc.photo_highlights", "ISC: Show Photo Highlights"),
            ("isc.relight", "ISC: Relight"),
            ("isc.own_material", "ISC: Make Material Single-User"),
        ):
            layout.operator(name, text=text)
        layout.separator()
        for name, text in (
            ("isc.auto_mask", "ISC: Auto Mask"),
            ("isc.mark_point", "ISC: Add Point to Mask"),
            ("isc.draw_box", "ISC: Select Box"),
            ("isc.decompose", "ISC: Create Object"),
        ):
            layout.operator(name, text=text)
        layout.separator()
        layout.operator("isc.save_asset", text="ISC: Save as Asset...")
        layout.operator("isc.export", text="ISC: Export Object...")
        layout.operator("isc.export_textures", text="ISC: Export Texture Set...")
        layout.operator("isc.import_result", text="ISC: Import Result...")


def _draw_import(menu: Any, context: Any) -> None:
    del context
    menu.layout.operator(_PHOTO, text="Photo as 3D Object")


def _draw_add(menu: Any, context: Any) -> None:
    del context
    menu.layout.separator()
    menu.layout.operator_context = "INVOKE_DEFAULT"
    menu.layout.operator(_PHOTO, text="Photo as 3D Object...", icon="IMAGE_DATA")


def _draw_image(menu: Any, context: Any) -> None:
    """Offer the image in the editor as the photo."""
    image = context.space_data.image
    menu.layout.separator()
    row = menu.layout.row()
    row.enabled = image is not None
    row.operator_context = "INVOKE_DEFAULT"
    row.operator(_PHOTO, text="Photo as 3D Object").image = image.name_full if image else ""


def _draw_object(menu: Any, context: Any) -> None:
    del context
    menu.layout.separator()
    menu.layout.menu(ISC_MT_object.bl_idname)


CLASSES = (ISC_MT_object,)
_ENTRIES = (
    ("TOPBAR_MT_file_import", _draw_import),
    ("VIEW3D_MT_mesh_add", _draw_add),
    ("IMAGE_MT_image", _draw_image),
    ("VIEW3D_MT_object", _draw_object),
)


def add_entries() -> None:
    """Add the entries; the classes must be registered."""
    for name, draw in _ENTRIES:
        getattr(bpy.types, name).append(draw)


def remove_entries() -> None:
    """Remove the entries."""
    for name, draw in _ENTRIES:
        getattr(bpy.types, name).remove(draw)
