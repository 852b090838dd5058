"""The tab "ISC" in the sidebars of the 3D view and the image editor.

Each panel is declared once and registered for both editors, as Blender requires a class for each.
"""
# mypy: allow-subclassing-any
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from typing import Any

import bpy

from .datablocks.provenance import KEY, find_tagged
from .materials.edit_nodes import dichromatic_node
from .materials.material import shows_highlights
from .materials.photo_highlights import can_show_highlights
from .operators.mask import mask_shown_on
from .operators.result import scene_before
from .runs.active_run import active_run
from .runs.messages import NOTE, is_about_mask
from .runs.worker_run import RunState
from .scene.built_object import BuiltObject, find_built, light_owner
from .scene.collection import LIGHT_AND_CAMERA, find_layer_collection
from .scene.copies import has_other_material, objects_sharing_material
from .settings.usage import unused_reason

_EDITORS = ("VIEW_3D", "IMAGE_EDITOR")
_COLOR_EDITS = ("Hue", "Saturation", "Value")
_STATE_ICONS = {
    RunState.DONE: "CHECKMARK",
    RunState.FAILED: "ERROR",
    RunState.CANCELLED: "CANCEL",
}
_THUMBNAIL_SCALE = 7.0
_LINE_LENGTH = 34  # characters that fit into a sidebar of default width


class _Panel:
    """Base class of the panels."""

    bl_region_type = "UI"
    bl_category = "ISC"
    layout: Any  # from bpy.types.Panel

    def property_column(self) -> Any:
        """A column of properties with their names on the left."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout.column()


class _Main(_Panel):
    bl_label = "Photo as 3D Object"

    def draw(self, context: Any) -> None:
        """Draw photo, mask, preset and button; during a run its progress."""
        settings, running = context.scene.isc, active_run() is not None
        before = scene_before(context.scene)
        if before is not None:
            text = f"Back to {before.name}"
            self.layout.operator("isc.return_to_scene", text=text, icon="LOOP_BACK")
        photo = self.layout.column()
        photo.enabled = not running
        photo.label(text="Photo")
        photo.template_ID(settings, "image", open="image.open")
        _draw_thumbnail(photo, settings)
        column = self.property_column()
        column.enabled = not running
        column.prop(settings, "mask_source")
        if settings.mask_source == "IMAGE":
            column.template_ID(settings, "mask", open="image.open")
            column.prop(settings, "scale_mask")
        column.prop(settings, "each")
        column.prop(settings, "preset")
        if running:
            draw_progress(self.layout, context)
        else:
            button = self.layout.row()
            button.scale_y = 1.5
            button.operator("isc.decompose", icon="MESH_MONKEY")
            _draw_outcome(self.layout, context)


class _Mask(_Panel):
    bl_label = "Create Mask"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """Draw the buttons for finding a mask, for painting it and for cutting it out of a box."""
        settings = context.scene.isc
        self.layout.operator("isc.auto_mask", icon="VIEWZOOM")
        row = self.layout.row(align=True)
        row.operator("isc.mark_point", text="Add Point", icon="ADD").background = False
        row.operator("isc.mark_point", text="Exclude", icon="REMOVE").background = True
        column = self.property_column()
        column.prop(settings, "points")
        column.prop(settings, "other_points")
        if settings.points or settings.other_points:
            self.layout.operator("isc.clear_points", icon="X")
        self.layout.operator("isc.new_mask", icon="BRUSH_DATA")
        self.layout.operator("isc.draw_box", icon="SELECT_SET")
        column = self.property_column()
        for index, name in enumerate(("Box Left", "Top", "Width", "Height")):
            column.prop(settings, "box", index=index, text=name)
        self.layout.operator("isc.cut_mask", icon="MOD_MASK")


class _Highlights(_Panel):
    bl_label = "Highlights"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """Draw which highlights are removed, and the buttons that mark highlights and print."""
        settings = context.scene.isc
        # Beside its choices, the name would be cut off.
        self.layout.label(text="Remove Highlights")
        draw_settings(self.layout.column(), settings, "highlight_odds", text="")
        row = self.layout.row(align=True)
        row.enabled = not unused_reason(settings, "highlights")
        row.operator("isc.mark_highlight", icon="ADD").reject = False
        row.operator("isc.mark_highlight", text="Mark as Print", icon="REMOVE").reject = True
        draw_settings(self.property_column(), settings, "highlights", "not_highlights")
        if settings.highlights or settings.not_highlights:
            self.layout.operator("isc.clear_highlights", icon="X")
        draw_settings(self.property_column(), settings, "refine")


class _Method(_Panel):
    bl_label = "Method"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """Draw the settings of how the object is recovered."""
        settings, column = context.scene.isc, self.property_column()
        draw_settings(column, settings, "model", "separator", "illumination", "light_color")
        if settings.light_color == "custom" and not unused_reason(settings, "light_color"):
            column.prop(settings, "custom_light_color")
        column.prop(settings, "camera")
        if settings.camera == "focal_length":
            column.prop(settings, "focal_length")
        draw_settings(column, settings, "max_size", "samples")


class _Output(_Panel):
    bl_label = "Output"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """Draw what is created, and what of the scene may change."""
        settings, column = context.scene.isc, self.property_column()
        draw_settings(column, settings, "size_metres", "texture_size", "specular_from")
        draw_settings(column, settings, "displacement", "back", "triangles")
        draw_settings(column, settings, "shadows", "sun", "all_maps")
        column.separator()
        column.prop(settings, "own_scene")
        if not settings.own_scene:
            column.prop(settings, "light_and_camera")
            changes = column.column(heading="Replace")
            for name in ("set_world", "set_camera", "set_resolution", "set_view_transform"):
                changes.prop(settings, name)
        self.layout.operator("isc.import_result", icon="IMPORT")


class _Edit(_Panel):
    bl_label = "Edit Object"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether an ISC object is active."""
        return find_built(context.object) is not None

    def draw(self, context: Any) -> None:
        """Draw the inputs of the material, the light, other sizes, and export."""
        built = find_built(context.object)
        if built is None:
            return
        self._draw_material(built)
        self._draw_light(context, built)
        column = self.property_column()
        column.prop(context.scene.isc, "max_size")
        self.layout.operator("isc.redo", icon="FILE_REFRESH").max_size = context.scene.isc.max_size
        self.layout.operator("isc.save_asset", icon="ASSET_MANAGER")
        self.layout.operator("isc.export", icon="EXPORT")
        self.layout.operator("isc.export_textures", icon="TEXTURE")

    def _draw_light(self, context: Any, built: BuiltObject) -> None:
        built = light_owner(built)
        column = self.layout.column(align=True)
        column.label(text="Light", icon="LIGHT_SUN")
        for light, text in (("OPTIMAL", "Estimated Sun"), ("CHOSEN", "Sun from the Side")):
            column.operator("isc.relight", text=text).light = light
        # In another world than the photo's, the button can only remove the sun.
        recovered = built.world is not None and context.scene.world == built.world
        text = "Recovered Light" if recovered else "Remove Sun"
        row = column.row(align=True)
        sun = find_tagged(bpy.data.objects, built.object[KEY], "sun")
        row.enabled = recovered or (sun is not None and sun.name in context.view_layer.objects)
        row.operator("isc.relight", text=text).light = "RECOVERED"
        part = find_tagged(bpy.data.collections, built.object[KEY], LIGHT_AND_CAMERA)
        entry = part and find_layer_collection(context.view_layer.layer_collection, part)
        if entry:
            row = self.layout.row()
            row.use_property_split = False
            row.alignment = "LEFT"
            # Its icon is the Outliner's checkbox, which shows what is included.
            row.prop(entry, "exclude", text="Photo's Light and Camera", emboss=False)

    def _draw_material(self, built: BuiltObject) -> None:
        if has_other_material(built.object, built.material):
            self.layout.label(text=f"Edits need the material {built.material.name}", icon="INFO")
            return
        node = dichromatic_node(built.material)
        if node is None:
            self.layout.label(text="The node ISC Dichromatic is missing", icon="INFO")
            return
        # The sliders would change all of them, and drawing a panel may change nothing.
        if objects_sharing_material(built.object, built.material):
            self.layout.label(text="Copies share this material", icon="INFO")
            self.layout.operator("isc.own_material", icon="MATERIAL")
            return
        column = self.property_column()
        column.label(text="Diffuse", icon="COLOR")
        for name in (*_COLOR_EDITS, "Diffuse Gain"):
            column.prop(node.inputs[name], "default_value", text=name)
        column.label(text="Specular", icon="MATERIAL")
        shown = shows_highlights(built.material)
        level = column.column()
        level.enabled = not shown
        level.prop(node.inputs["Specular Level"], "default_value", text="Specular Level")
        gloss = level.column()
        gloss.enabled = not shown and node.inputs["Specular Level"].default_value > 0
        for name in ("Roughness", "Gloss Gain"):
            if name in node.inputs:
                gloss.prop(node.inputs[name], "default_value", text=name)
        gain = column.column()
        gain.enabled = shown or gloss.enabled
        gain.prop(node.inputs["Specular Gain"], "default_value", text="Specular Gain")
        if shown:
            column.label(text="Showing the photo's highlights", icon="INFO")
        elif not gloss.enabled:
            column.label(text="No gloss at specular level 0", icon="INFO")
        if can_show_highlights(built.material):
            text = f"{'Hide' if shown else 'Show'} Photo Highlights"
            column.operator("isc.photo_highlights", text=text).show = not shown


def draw_settings(column: Any, settings: Any, *names: str, **label: str) -> None:
    """Draw settings; those without an effect are greyed out, with the reason below.

    Parameters
    ----------
    column : bpy.types.UILayout
        Where to draw.
    settings : ISC_PG_settings
        The settings of the scene.
    *names : str
        Names of the settings. Those that are unused for one reason stand together.
    **label : str
        `text` in place of their own names.
    """
    reason = ""
    for name in names:
        previous, reason = reason, unused_reason(settings, name)
        if previous and previous != reason:
            column.label(text=previous, icon="INFO")
        row = column.row()
        row.enabled = not reason
        row.prop(settings, name, **label)
    if reason:
        column.label(text=reason, icon="INFO")


def draw_progress(layout: Any, context: Any) -> None:
    """Draw the progress bar with the stage's name, and the button that cancels.

    Parameters
    ----------
    layout : bpy.types.UILayout
        Where to draw.
    context : bpy.types.Context
        Blender's context.
    """
    shown = context.window_manager.isc
    column = layout.column(align=True)
    column.progress(factor=shown.fraction, text=shown.stage or "running")
    column.operator("isc.cancel", icon="X")


def _draw_thumbnail(layout: Any, settings: Any) -> None:
    """Draw the photo, or the photo with its mask over it."""
    image = settings.image
    mask = settings.mask if settings.mask_source == "IMAGE" else None
    if mask is not None and mask_shown_on(mask) == image:
        image = mask
    if image is not None:
        layout.template_icon(icon_value=layout.icon(image), scale=_THUMBNAIL_SCALE)
    if mask is not None and image == mask:
        row = layout.row(align=True)
        row.operator("isc.mark_point", text="Add", icon="ADD").background = False
        row.operator("isc.mark_point", text="Exclude", icon="REMOVE").background = True
        row.operator("isc.draw_box", text="Box", icon="SELECT_SET")


def _draw_outcome(layout: Any, context: Any) -> None:
    """Draw the outcome of the last run: a line, remedies, and the details in a closed subpanel."""
    shown = context.window_manager.isc
    icons = {str(state): icon for state, icon in _STATE_ICONS.items()}
    if shown.state not in icons or not shown.message:
        return
    advice, notes = read_notes(shown.notes)
    row = layout.row()
    column = row.column(align=True)
    for number, line in enumerate(wrap_text(shown.message, _LINE_LENGTH)):
        column.label(text=line, icon="BLANK1" if number else icons[shown.state])
    if advice:
        row.operator("isc.show_notes", text="", icon="ERROR", emboss=False).notes = "\n".join(
            advice
        )
    if shown.state == RunState.FAILED and is_about_mask(shown.message):
        fixes = layout.row(align=True)
        fixes.operator("isc.mark_point", icon="ADD").background = False
        fixes.operator("isc.draw_box", icon="SELECT_SET")
    if notes:
        header, body = layout.panel("ISC_details", default_closed=True)
        header.label(text="Details")
        if body is not None:
            lines = body.column(align=True)
            for note in notes:
                for line in wrap_text(note, _LINE_LENGTH):
                    lines.label(text=line)


def read_notes(text: str) -> tuple[list[str], list[str]]:
    """Read the notes on a result.

    Parameters
    ----------
    text : str
        One note a line.

    Returns
    -------
    advice, notes : list of str
        Those that advise something, and all.
    """
    lines = text.splitlines()
    notes = [line.removeprefix(NOTE) for line in lines]
    notes = [f"{note[:1].upper()}{note[1:]}" for note in notes]
    return [note for note, line in zip(notes, lines, strict=True) if line.startswith(NOTE)], notes


def wrap_text(text: str, width: int) -> list[str]:
    """Break a text into lines between words.

    Parameters
    ----------
    text : str
        The text.
    width : int
        Maximum number of characters per line; a longer word has its own line.

    Returns
    -------
    list of str
        At least one line.
    """
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def _create_class(panel: Any, order: int, editor: str) -> type:
    """The panel's class for one editor."""
    name = f"ISC_PT_{panel.__name__.strip('_').lower()}_{editor.lower()}"
    return type(
        name,
        (panel, bpy.types.Panel),
        {"bl_space_type": editor, "bl_idname": name, "bl_order": order, "__doc__": panel.bl_label},
    )


_PANELS = (_Main, _Mask, _Highlights, _Method, _Output)
CLASSES = (
    *(
        _create_class(panel, order, editor)
        for editor in _EDITORS
        for order, panel in enumerate(_PANELS)
    ),
    # Objects are edited in the 3D view alone.
    _create_class(_Edit, len(_PANELS), "VIEW_3D"),
)
