"""Masks: cut out of a box that is drawn in the image editor or typed, or painted on a black image
of the photo's size.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender wants its options as sets)

from math import ceil, floor
from pathlib import Path
from typing import Any

import bpy
import gpu  # type: ignore[import-not-found]
from bpy.props import StringProperty
from gpu_extras.batch import batch_for_shader  # type: ignore[import-not-found]

from isc_core.errors import InputError

from ..files.image_export import examine
from ..settings.preferences import choices, new_folder, worker_environment
from .modal import WorkerOperator
from .request import named
from .run_steps import cut_out
from .worker_run import Run, active, remove, require_idle

_MASK_OF = "isc_mask_of"
_LEAST = 8
Box = tuple[int, int, int, int]


class ISC_OT_cut_mask(WorkerOperator, bpy.types.Operator):
    """Cuts the object inside the box out of the photo."""

    bl_idname = "isc.cut_mask"
    bl_label = "Cut Out"
    bl_description = "Find the object inside the box by its colours, and make that the mask; look at it before you use it"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """With a photo, while no run goes on."""
        return _can_cut(cls, context)

    def prepare(self, context: Any) -> Run:
        """The run. Raises `InputError`."""
        require_idle()
        settings = context.scene.isc
        if settings.image is None:
            raise InputError(
                "there is no photo: open a file, or choose an image that is in Blender already"
            )
        box = tuple(int(number) for number in settings.box)
        if min(box[2:]) < _LEAST:
            raise InputError(
                f"the box is less than {_LEAST} pixels wide or high: draw it around the object in the image editor"
            )
        photo, scene = examine(settings.image), context.scene.name_full
        folder = new_folder(None, "mask")

        def finish(now: Any, path: Path) -> str:
            del now
            _take_mask(path, photo.name, scene)
            remove(folder)
            return "the mask is cut out: look at it before you use it"

        script = cut_out(
            photo, (box[0], box[1], box[2], box[3]), folder, worker_environment(choices(context))
        )
        return Run("Cut Out", script, finish, folder)


class ISC_OT_take_mask(bpy.types.Operator):
    """Makes a picture file the mask of a photo."""

    bl_idname = "isc.take_mask"
    bl_label = "Take Mask"
    bl_description = "Load a mask from a file, pack it, and make it the mask of a photo"
    bl_options = {"UNDO", "INTERNAL"}

    filepath: StringProperty(name="File", description="The mask's file", subtype="FILE_PATH")
    image: StringProperty(name="Photo", description="The photo's full name")
    scene: StringProperty(
        name="Scene", description="The full name of the scene whose mask it becomes"
    )

    def execute(self, context: Any) -> set[str]:
        """Loads it; a mask that was cut out before is replaced."""
        scene, photo = (
            named(bpy.data.scenes, self.scene) or context.scene,
            named(bpy.data.images, self.image),
        )
        try:
            mask = bpy.data.images.load(self.filepath)
        except RuntimeError:
            self.report({"ERROR"}, f"the mask {self.filepath} cannot be read: cut it out again")
            return {"CANCELLED"}
        mask.pack()
        mask.filepath = ""
        name = "mask" if photo is None else f"{photo.name} mask"
        mask.colorspace_settings.name = "Non-Color"
        _replace_mask(mask, name)
        scene.isc.mask, scene.isc.mask_source = mask, "IMAGE"
        return {"FINISHED"}


class ISC_OT_new_mask(bpy.types.Operator):
    """A black image of the photo's size, to paint the object on in white."""

    bl_idname = "isc.new_mask"
    bl_label = "New Mask to Paint"
    bl_description = (
        "A black image of the photo's size: paint the object on it in white (image editor, Paint)"
    )
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Makes it, and shows it for painting where this is called from an image editor."""
        settings = context.scene.isc
        image = settings.image
        if image is None or 0 in tuple(image.size):
            self.report({"ERROR"}, "choose a photo first: the mask takes its size")
            return {"CANCELLED"}
        mask = bpy.data.images.new(f"{image.name} mask", *image.size, alpha=False)
        mask.colorspace_settings.name = "Non-Color"
        settings.mask, settings.mask_source = mask, "IMAGE"
        if context.area is not None and context.area.type == "IMAGE_EDITOR":
            context.space_data.image, context.space_data.mode = mask, "PAINT"
        return {"FINISHED"}


class ISC_OT_draw_box(bpy.types.Operator):
    """A box drawn around the object with the mouse."""

    bl_idname = "isc.draw_box"
    bl_label = "Draw Box"
    bl_description = (
        "Draw a box around the object, with some background in it, and cut the object out of it"
    )

    _start: tuple[int, int] | None = None
    _end: tuple[int, int] = (0, 0)
    _handler: Any = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        """In an image editor that shows the photo, while no run goes on."""
        if (
            context.area is None
            or context.area.type != "IMAGE_EDITOR"
            or context.space_data.image is None
        ):
            cls.poll_message_set("Show the photo in an image editor")
            return False
        return active() is None

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Waits for the mouse."""
        del event
        context.scene.isc.image = context.space_data.image
        context.window.cursor_modal_set("CROSSHAIR")
        context.workspace.status_text_set(
            "Draw a box around the object; Esc or right button: leave it"
        )
        self._handler = bpy.types.SpaceImageEditor.draw_handler_add(
            self._draw, (), "WINDOW", "POST_PIXEL"
        )
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Press, drag, release."""
        region = _canvas(context)
        place = (event.mouse_x - region.x, event.mouse_y - region.y)
        if event.type in {"ESC", "RIGHTMOUSE"}:
            return self._leave(context, {"CANCELLED"})
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            self._start = self._end = place
        elif event.type == "MOUSEMOVE" and self._start is not None:
            self._end = place
            region.tag_redraw()
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE" and self._start is not None:
            self._end = place
            return self._finish(context, region)
        elif self._start is None:
            return {"PASS_THROUGH"}  # so that the view can be moved before
        return {"RUNNING_MODAL"}

    def cancel(self, context: Any) -> None:
        """Blender ends the operator itself."""
        self._leave(context, set())

    def _finish(self, context: Any, region: Any) -> set[str]:
        corners = [
            region.view2d.region_to_view(*place) for place in (self._start or self._end, self._end)
        ]
        box = box_of(corners[0], corners[1], tuple(context.space_data.image.size))
        self._leave(context, set())
        if box is None:
            self.report(
                {"WARNING"},
                f"the box is less than {_LEAST} pixels wide or high: draw it around the object",
            )
            return {"CANCELLED"}
        context.scene.isc.box = box
        bpy.ops.isc.cut_mask("INVOKE_DEFAULT")
        return {"FINISHED"}

    def _leave(self, context: Any, result: set[str]) -> set[str]:
        if self._handler is not None:
            bpy.types.SpaceImageEditor.draw_handler_remove(self._handler, "WINDOW")
            self._handler = None
            context.window.cursor_modal_restore()
            context.workspace.status_text_set(None)
            _canvas(context).tag_redraw()
        return result

    def _draw(self) -> None:
        if self._start is None:
            return
        (left, bottom), (right, top) = self._start, self._end
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        shader.uniform_float("color", (1.0, 0.6, 0.1, 1.0))
        corners = ((left, bottom), (right, bottom), (right, top), (left, top), (left, bottom))
        batch_for_shader(shader, "LINE_STRIP", {"pos": [(x, y, 0.0) for x, y in corners]}).draw(
            shader
        )


def box_of(
    first: tuple[float, float], second: tuple[float, float], size: tuple[int, ...]
) -> Box | None:
    """(left, top, width, height) in pixels, from the top, of two corners in the image editor's
    view: (0, 0) is the image's lower left corner, (1, 1) its upper right one. Cut to the image of
    `size` (width, height); None if less than 8 pixels are left.
    """
    width, height = size
    across = sorted(min(max(u * width, 0), width) for u in (first[0], second[0]))
    down = sorted(min(max((1 - v) * height, 0), height) for v in (first[1], second[1]))
    left, top = floor(across[0]), floor(down[0])
    box = (left, top, ceil(across[1]) - left, ceil(down[1]) - top)
    return box if min(box[2:]) >= _LEAST else None


def _take_mask(path: Path, image: str, scene: str) -> None:
    try:
        bpy.ops.isc.take_mask("EXEC_DEFAULT", True, filepath=str(path), image=image, scene=scene)
    except RuntimeError as error:
        raise InputError(str(error).strip().removeprefix("Error: ")) from error


def _replace_mask(mask: Any, name: str) -> None:
    """Gives the mask its name; one that was cut out before under that name hands its users over and
    goes.
    """
    old = next(
        (
            image
            for image in bpy.data.images
            if image.get(_MASK_OF) == name and image.library is None
        ),
        None,
    )
    if old is not None:
        old.user_remap(mask)
        bpy.data.images.remove(old)
    mask.name, mask[_MASK_OF] = name, name


def _can_cut(operator: Any, context: Any) -> bool:
    if context.scene.isc.image is None:
        operator.poll_message_set("Choose a photo first")
        return False
    present = active()
    if present is not None:
        operator.poll_message_set(f"{present.title} is going on: wait for it, or cancel it first")
    return present is None


def _canvas(context: Any) -> Any:
    """The region that shows the image: the button may have been pressed in the sidebar."""
    return next(region for region in context.area.regions if region.type == "WINDOW")
