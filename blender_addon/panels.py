"""The tab "ISC" in the sidebars of the 3D view and the image editor.

Each panel is declared once and stands in both editors: Blender wants a class a place.
"""
# mypy: allow-subclassing-any
# ruff: noqa: RUF012 (Blender wants its options as sets)

from typing import Any

import bpy

from .operators.worker_run import active
from .scene.build import Built, find
from .scene.copies import sharers
from .scene.material import dichromatic_node

_PLACES = ("VIEW_3D", "IMAGE_EDITOR")
_PAINT = ("Hue", "Saturation", "Value")
_STATE_ICONS = {"done": "CHECKMARK", "failed": "ERROR", "cancelled": "CANCEL"}
_LINE = 34  # letters of a message that fit into a sidebar of usual width


class _Panel:
    """What all panels share."""

    bl_region_type = "UI"
    bl_category = "ISC"
    layout: Any  # Blender's own

    def columns(self) -> Any:
        """The layout as properties with their names on the left."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout.column()


class _Main(_Panel):
    bl_label = "Photo to Object"

    def draw(self, context: Any) -> None:
        """Photo, mask, preset and the button; while the work goes on, how far it is."""
        settings, going = context.scene.isc, active() is not None
        photo = self.layout.column()
        photo.enabled = not going
        photo.label(text="Photo")
        photo.template_ID(settings, "image", new="image.new", open="image.open")
        column = self.columns()
        column.enabled = not going
        column.prop(settings, "mask_source")
        if settings.mask_source == "IMAGE":
            column.template_ID(settings, "mask", open="image.open")
            column.prop(settings, "scale_mask")
        column.prop(settings, "preset")
        if going:
            draw_progress(self.layout, context)
        else:
            button = self.layout.row()
            button.scale_y = 1.5
            button.operator("isc.decompose", icon="SHADING_TEXTURE")
            _draw_end(self.layout, context)


class _Mask(_Panel):
    bl_label = "Make a Mask"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """Painting, and cutting out of a box."""
        settings = context.scene.isc
        self.layout.operator("isc.new_mask", icon="BRUSH_DATA")
        if context.area.type == "IMAGE_EDITOR":
            self.layout.operator("isc.draw_box", icon="SELECT_SET")
        column = self.columns()
        for index, name in enumerate(("Box Left", "Top", "Width", "Height")):
            column.prop(settings, "box", index=index, text=name)
        self.layout.operator("isc.cut_mask", icon="MOD_MASK")


class _Method(_Panel):
    bl_label = "Method"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """How the photo is taken apart."""
        settings, column = context.scene.isc, self.columns()
        for name in ("model", "separator", "illumination", "max_size", "samples"):
            column.prop(settings, name)


class _Build(_Panel):
    bl_label = "What Is Built"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """What is made of the result, and what of the scene may change."""
        settings, column = context.scene.isc, self.columns()
        column.prop(settings, "size_metres")
        column.prop(settings, "specular_from")
        for name in ("shadows", "sun", "displacement", "closed_back"):
            column.prop(settings, name)
        column.separator()
        column.prop(settings, "own_scene")
        if not settings.own_scene:
            change = column.column(heading="May Change")
            for name in ("set_world", "set_camera", "set_resolution", "set_view_transform"):
                change.prop(settings, name)
        self.layout.operator("isc.import_result", icon="IMPORT")


class _Edit(_Panel):
    bl_label = "Edit Object"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """With an object of ISC active."""
        return find(context.object) is not None

    def draw(self, context: Any) -> None:
        """The sockets of its material, its light, other sizes, files."""
        built = find(context.object)
        if built is None:
            return
        self._draw_material(built)
        column = self.layout.column(align=True)
        column.label(text="Light", icon="LIGHT_SUN")
        for light, text in (
            ("OPTIMAL", "Sun, Best Direction"),
            ("CHOSEN", "Sun from the Side"),
            ("RECOVERED", "As in the Photo"),
        ):
            column.operator("isc.relight", text=text).light = light
        column = self.columns()
        column.prop(context.scene.isc, "max_size")
        self.layout.operator("isc.redo", icon="FILE_REFRESH").max_size = context.scene.isc.max_size
        self.layout.operator("isc.export", icon="EXPORT")

    def _draw_material(self, built: Built) -> None:
        node = dichromatic_node(built.material)
        if node is None:
            self.layout.label(text="The material's nodes were replaced", icon="INFO")
            return
        if sharers(
            built.object, built.material
        ):  # sliders would change them all, and drawing may change nothing
            self.layout.label(text="Its copies share paint and gloss", icon="INFO")
            self.layout.operator("isc.own_material", icon="MATERIAL")
            return
        column = self.columns()
        column.label(text="Paint", icon="COLOR")
        for name in (*_PAINT, "Diffuse Gain"):
            column.prop(node.inputs[name], "default_value", text=name)
        column.label(text="Gloss", icon="MATERIAL")
        for name in ("Specular Level", "Roughness"):
            column.prop(node.inputs[name], "default_value", text=name)
        column.operator(
            "isc.dichromatic", text=f"Gloss Gain {node.inputs['Specular Gain'].default_value:.2f}"
        )


def draw_progress(layout: Any, context: Any) -> None:
    """The bar with the stage's name, and the button that ends the run."""
    shown = context.window_manager.isc
    column = layout.column(align=True)
    column.progress(factor=shown.fraction, text=shown.stage or "working")
    column.operator("isc.cancel", icon="X")


def _draw_end(layout: Any, context: Any) -> None:
    """How the last run ended, in lines that fit."""
    shown = context.window_manager.isc
    if shown.state not in _STATE_ICONS or not shown.message:
        return
    column = layout.column(align=True)
    for number, line in enumerate(wrapped(shown.message, _LINE)):
        column.label(text=line, icon="BLANK1" if number else _STATE_ICONS[shown.state])


def wrapped(text: str, width: int) -> list[str]:
    """The words of a text in lines of at most `width` letters, where words are not longer than
    that.
    """
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


def _placed(panel: Any, number: int, place: str) -> type:
    """The panel's class for one editor.

    Editing is for objects, so it stands in the 3D view alone.
    """
    name = f"ISC_PT_{panel.__name__.strip('_').lower()}_{place.lower()}"
    return type(
        name,
        (panel, bpy.types.Panel),
        {"bl_space_type": place, "bl_idname": name, "bl_order": number, "__doc__": panel.bl_label},
    )


_ORDER = (_Main, _Mask, _Method, _Build)
CLASSES = (
    *(_placed(panel, number, place) for place in _PLACES for number, panel in enumerate(_ORDER)),
    _placed(_Edit, len(_ORDER), "VIEW_3D"),
)
