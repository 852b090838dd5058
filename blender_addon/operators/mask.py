"""Masks: segmented inside a box that is drawn on the photo or typed, or painted on a black image of
the photo's size.
"""
# mypy: allow-subclassing-any, disable-error-code="valid-type"
# ruff: noqa: RUF012 (Blender requires sets for operator options)

from collections.abc import Callable
from math import ceil, floor
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy.props import StringProperty

from isc_core.errors import InputError

from ..datablocks.provenance import MASK_OF
from ..files.checksums import crc32_of
from ..files.image_source import ImageSource, inspect_image
from ..runs.active_run import require_no_active_run
from ..runs.messages import error_line, sentence
from ..runs.request import DecomposeRequest, find_by_full_name, require_photo, track_names
from ..runs.run_steps import mask_steps
from ..runs.worker_run import ImportSteps, RunOutput, RunSteps, WorkerRun, remove_folder
from ..settings.preferences import create_run_folder, read_preferences, worker_environment
from ..worker.commands import Box, WorkerEnvironment, overlay_of
from .modal import NeedsPhoto, WorkerOperator, start_operator
from .photo_canvas import PhotoCanvas
from .photo_operators import DragOnPhoto

# Of a mask with a preview: the photo, and the checksum of the packed file that it shows.
_SHOWN_ON, _SHOWN_FILE = "isc_shown_on", "isc_shown_crc32"
_MIN_SIDE = 8


class ISC_OT_cut_mask(NeedsPhoto, WorkerOperator, bpy.types.Operator):
    """Segment the object inside the box and make it the mask."""

    bl_idname = "isc.cut_mask"
    bl_label = "Cut Out"
    bl_description = "Create the mask by segmenting the object inside the box by color"

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
            If no photo is selected, it cannot be used, the box is too small, or a run is active.
        """
        require_no_active_run()
        settings = context.scene.isc
        require_photo(settings)
        left, top, width, height = (int(number) for number in settings.box)
        if min(width, height) < _MIN_SIDE:
            raise InputError(_small_box_message())
        box = left, top, width, height
        return mask_run(
            context,
            "Cut Out",
            lambda photo, folder, environment: mask_steps(photo, box, folder, environment),
        )


def mask_run(
    context: Any, title: str, steps: Callable[[ImageSource, Path, WorkerEnvironment], RunSteps]
) -> WorkerRun:
    """Create a run that makes the mask of the scene's photo.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.
    title : str
        Name of the run in the panel.
    steps : callable
        Of the photo, the run's folder and the worker's environment.

    Returns
    -------
    WorkerRun
        The run, not started.

    Raises
    ------
    InputError
        If the photo cannot be used.
    """
    photo = inspect_image(context.scene.isc.image)
    request = DecomposeRequest(image=photo.name, scene=context.scene.name_full)
    renamed = track_names(request)
    folder = create_run_folder(None, "mask")

    def finish(context: Any, output: RunOutput) -> ImportSteps:
        del context
        yield
        load_mask(output.path, renamed().image, renamed().scene)
        remove_folder(folder)
        return "Mask found: check it, then press Create Object"

    environment = worker_environment(read_preferences(context))
    return WorkerRun(title, steps(photo, folder, environment), finish, folder)


class ISC_OT_take_mask(bpy.types.Operator):
    """Make an image file the mask of a photo."""

    bl_idname = "isc.take_mask"
    bl_label = "Load Mask"
    bl_description = "Load a mask from a file, pack it, and use it for a photo"
    bl_options = {"UNDO", "INTERNAL"}

    filepath: StringProperty(name="File", description="File of the mask", subtype="FILE_PATH")
    image: StringProperty(name="Photo", description="Full name of the photo")
    scene: StringProperty(name="Scene", description="Full name of the scene that uses the mask")

    def execute(self, context: Any) -> set[str]:
        """Load the mask; it replaces one that was cut out earlier.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}, or {"CANCELLED"} after an error has been reported.
        """
        scene = find_by_full_name(bpy.data.scenes, self.scene) or context.scene
        photo = find_by_full_name(bpy.data.images, self.image)
        if photo is not None and photo != scene.isc.image:
            message = f"The panel has another photo than {photo.name} now: find the mask again"
            self.report({"ERROR"}, message)
            return {"CANCELLED"}
        try:
            mask = bpy.data.images.load(self.filepath)
        except RuntimeError:
            self.report({"ERROR"}, f"The mask {self.filepath} cannot be read: cut it out again")
            return {"CANCELLED"}
        mask.pack()
        mask.filepath = ""
        name = "mask" if photo is None else f"{photo.name} mask"
        mask.colorspace_settings.name = "Non-Color"
        _replace_mask(mask, photo, name)
        if photo is not None:
            _set_overlay(mask, photo, overlay_of(Path(self.filepath)))
        scene.isc.mask, scene.isc.mask_source = mask, "IMAGE"
        return {"FINISHED"}


class ISC_OT_new_mask(bpy.types.Operator):
    """Create a black image of the photo's size to paint the mask on."""

    bl_idname = "isc.new_mask"
    bl_label = "New Mask to Paint"
    bl_description = (
        "Create a black image of the photo's size on which to paint the object in white"
    )
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Create the image; an image editor shows it in Paint mode.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}, or {"CANCELLED"} if no photo is selected.
        """
        settings = context.scene.isc
        image = settings.image
        if image is None or 0 in tuple(image.size):
            self.report({"ERROR"}, "No photo is selected: choose one, the mask takes its size")
            return {"CANCELLED"}
        mask = bpy.data.images.new(f"{image.name} mask", *image.size, alpha=False)
        mask.colorspace_settings.name = "Non-Color"
        settings.mask, settings.mask_source = mask, "IMAGE"
        if context.area is not None and context.area.type == "IMAGE_EDITOR":
            context.space_data.image, context.space_data.mode = mask, "PAINT"
        return {"FINISHED"}


class ISC_OT_draw_box(DragOnPhoto, bpy.types.Operator):
    """Draw a box around the object with the mouse, and cut the object out."""

    bl_idname = "isc.draw_box"
    bl_label = "Select Box"
    bl_description = (
        "Draw a box around the object, with some background, and cut the object out of it"
    )

    def status_text(self) -> str:
        """Return what to do with the mouse; see `PhotoOperator`.

        Returns
        -------
        str
        """
        return "Draw a box around the object, Esc or right mouse button to cancel"

    def finish(self, context: Any, canvas: PhotoCanvas, path: list[tuple[int, int]]) -> set[str]:
        """Cut the object out of the box between both ends of the path; see `DragOnPhoto`.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        canvas : PhotoCanvas
            Where the photo is drawn.
        path : list of tuple of int
            Positions of the mouse.

        Returns
        -------
        set of str
            {"CANCELLED"} if the box is too small.
        """
        box = box_from_corners(canvas.place(path[0]), canvas.place(path[-1]), self._size)
        self._leave(context, set())
        if box is None:
            self.report({"WARNING"}, sentence(_small_box_message()))
            return {"CANCELLED"}
        context.scene.isc.box = box
        start_operator(self, bpy.ops.isc.cut_mask)
        return {"FINISHED"}

    def outline(self, path: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return the box between both ends of the path; see `DragOnPhoto`.

        Parameters
        ----------
        path : list of tuple of int
            Positions of the mouse so far.

        Returns
        -------
        list of tuple of int
            Its corners, the first one twice.
        """
        (left, bottom), (right, top) = path[0], path[-1]
        return [(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)]


def box_from_corners(
    first: tuple[float, float], second: tuple[float, float], size: tuple[int, ...]
) -> Box | None:
    """Convert two corners in the image editor's view to a box in pixels.

    Parameters
    ----------
    first, second : tuple of float
        Opposite corners; (0, 0) is the image's lower left corner, (1, 1) its upper right one.
    size : tuple of int
        Width and height of the image in pixels.

    Returns
    -------
    tuple of int or None
        Left, top, width and height, clipped to the image; None below 8 pixels.
    """
    width, height = size
    across = sorted(min(max(u * width, 0), width) for u in (first[0], second[0]))
    down = sorted(min(max((1 - v) * height, 0), height) for v in (first[1], second[1]))
    left, top = floor(across[0]), floor(down[0])
    box = (left, top, ceil(across[1]) - left, ceil(down[1]) - top)
    return box if min(box[2:]) >= _MIN_SIDE else None


def _small_box_message() -> str:
    return f"the box is less than {_MIN_SIDE} pixels wide or high: draw it around the object"


def _set_overlay(mask: Any, photo: Any, path: Path) -> None:
    """Make the picture of the mask on its photo the preview of the mask."""
    if not path.is_file():
        return
    picture = bpy.data.images.load(str(path))
    width, height = picture.size
    pixels = np.empty(4 * width * height, np.float32)
    picture.pixels.foreach_get(pixels)
    bpy.data.images.remove(picture)
    preview = mask.preview_ensure()
    preview.image_size = width, height
    preview.image_pixels_float.foreach_set(pixels)
    mask[_SHOWN_ON], mask[_SHOWN_FILE] = photo, _checksum(mask)


def _checksum(mask: Any) -> str:
    """Of the packed file; "" if there is none."""
    return "" if mask.packed_file is None else crc32_of(mask.packed_file.data)


def mask_shown_on(mask: Any) -> Any:
    """Return the photo on which the preview of a mask shows it.

    Parameters
    ----------
    mask : bpy.types.Image
        The mask.

    Returns
    -------
    bpy.types.Image or None
        None where the preview shows something else, as after the mask was painted on.
    """
    photo = mask.get(_SHOWN_ON)
    # It was painted on, perhaps saved or packed since.
    changed = photo is None or mask.is_dirty or mask.get(_SHOWN_FILE) != _checksum(mask)
    return None if changed else photo


def load_mask(path: Path, image: str, scene: str) -> None:
    """Make a file the mask of a photo.

    Parameters
    ----------
    path : Path
        File of the mask.
    image, scene : str
        Full names of the photo and of the scene that uses the mask.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    try:
        bpy.ops.isc.take_mask("EXEC_DEFAULT", True, filepath=str(path), image=image, scene=scene)
    except RuntimeError as error:
        raise InputError(error_line(error)) from error


def _replace_mask(mask: Any, photo: Any, name: str) -> None:
    """Name the mask; it replaces one that was found earlier in the same photo."""
    of = (name,) if photo is None else (photo, name)
    old = next(
        (image for image in bpy.data.images if image.get(MASK_OF) in of and image.library is None),
        None,
    )
    if old is not None:
        old.user_remap(mask)
        bpy.data.images.remove(old)
    mask.name, mask[MASK_OF] = name, of[0]
