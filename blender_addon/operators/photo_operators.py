"""Operators that wait for the mouse on the photo.

`PhotoOperator` waits, `ClickOnPhoto` for a click on a pixel, `StrokeOnPhoto` for a click or a
stroke, `DragOnPhoto` for any path of the mouse.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import floor, hypot
from typing import Any

import gpu  # type: ignore[import-not-found]
import numpy as np
from gpu_extras.batch import batch_for_shader  # type: ignore[import-not-found]

from ..runs.active_run import poll_idle
from .photo_canvas import PhotoCanvas

_SPACING, _MAX_POINTS = 0.02, 8  # of the points of a stroke: of the photo's longer side; how many
_LINE_COLOR = (1.0, 0.6, 0.1, 1.0)
OUTSIDE = "The point lies outside the photo: click on the photo"


def shown_photo(context: Any) -> Any:
    """Return the photo that can be pointed at in the editor under the mouse.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.

    Returns
    -------
    bpy.types.Image or None
        The image of an image editor, or that of the panel in a 3D view; None elsewhere.
    """
    kind = "" if context.area is None else context.area.type
    if kind == "IMAGE_EDITOR":
        return context.space_data.image
    return context.scene.isc.image if kind == "VIEW_3D" else None


class PhotoOperator:
    """An operator that waits for the mouse on the photo; a base beside `bpy.types.Operator`."""

    report: Any  # from bpy.types.Operator
    poll_message_set: Any
    _size: tuple[int, ...] = (0, 0)
    _canvas: PhotoCanvas | None = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether there is a photo to point at and no run is active.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
            Where False, the tooltip gives the reason.
        """
        if shown_photo(context) is None:
            cls.poll_message_set("Open a photo first")
            return False
        return poll_idle(cls)

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
            {"RUNNING_MODAL"}; {"CANCELLED"} if the photo has no pixels.
        """
        del event
        settings, shown = context.scene.isc, shown_photo(context)
        self._size = tuple(shown.size)
        if 0 in self._size:
            self.report({"ERROR"}, f"The image {shown.name} has no data: open its file again")
            return {"CANCELLED"}
        if shown not in (settings.image, settings.mask):
            settings.image = shown
        mask = self.mask_to_show(settings)
        fits = mask is not None and tuple(mask.size) == self._size
        self._canvas = PhotoCanvas(context, shown, self.draw_over, mask if fits else None)
        context.window.cursor_modal_set("CROSSHAIR")
        context.workspace.status_text_set(self.status_text())
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Pass an event on with the position of the mouse.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            Event of the mouse or keyboard; its position is in pixels of the window.

        Returns
        -------
        set of str
            As of `handle_event`; {"CANCELLED"} on Esc, the right mouse button, or where the region
            is gone.
        """
        position = None if self._canvas is None else self._canvas.position(event)
        if self._canvas is None or position is None or event.type in {"ESC", "RIGHTMOUSE"}:
            return self._leave(context, {"CANCELLED"})
        return self.handle_event(context, event, self._canvas, position)

    def handle_event(
        self, context: Any, event: Any, canvas: PhotoCanvas, position: tuple[int, int]
    ) -> set[str]:
        """Use an event; the operator's own.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            Event of the mouse or keyboard.
        canvas : PhotoCanvas
            Where the photo is drawn.
        position : tuple of int
            Of the mouse, in pixels of the region.

        Returns
        -------
        set of str
            {"RUNNING_MODAL"} or {"PASS_THROUGH"} while waiting, {"FINISHED"} or {"CANCELLED"}.
        """
        raise NotImplementedError

    def status_text(self) -> str:
        """Return what to do with the mouse, for the status bar; the operator's own.

        Returns
        -------
        str
        """
        raise NotImplementedError

    def mask_to_show(self, settings: Any) -> Any:
        """Return the mask that is shown over the photo; none here.

        Parameters
        ----------
        settings : ISC_PG_settings
            Of the scene.

        Returns
        -------
        bpy.types.Image or None
        """
        del settings

    def draw_over(self) -> None:
        """Draw over the photo, in pixels of the region; nothing here."""

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


class ClickOnPhoto(PhotoOperator):
    """An operator that waits for a click on the photo."""

    def use_point(self, settings: Any, point: str) -> None:
        """Use the click; the operator's own.

        Parameters
        ----------
        settings : ISC_PG_settings
            Of the scene.
        point : str
            Column and row, such as "120,80".
        """
        raise NotImplementedError

    def handle_event(
        self, context: Any, event: Any, canvas: PhotoCanvas, position: tuple[int, int]
    ) -> set[str]:
        """Take the click of the left mouse button; see `PhotoOperator`.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            Event of the mouse or keyboard.
        canvas : PhotoCanvas
            Where the photo is drawn.
        position : tuple of int
            Of the mouse.

        Returns
        -------
        set of str
            {"PASS_THROUGH"} while waiting; {"FINISHED"} with a point; {"CANCELLED"} on a click
            beside the photo.
        """
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}
        point = point_at(canvas.place(position), self._size)
        self._leave(context, set())
        if point is None:
            self.report({"WARNING"}, OUTSIDE)
            return {"CANCELLED"}
        self.use_point(context.scene.isc, f"{point[0]},{point[1]}")
        return {"FINISHED"}


class DragOnPhoto(PhotoOperator):
    """An operator that waits for the mouse to be dragged over the photo, and draws its path."""

    line_width = 1.0
    _path: list[tuple[int, int]] | None = None

    def finish(self, context: Any, canvas: PhotoCanvas, path: list[tuple[int, int]]) -> set[str]:
        """Leave, and use the path; the operator's own.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        canvas : PhotoCanvas
            Where the photo is drawn.
        path : list of tuple of int
            Positions of the mouse from press to release, in pixels of the region.

        Returns
        -------
        set of str
            {"FINISHED"} or {"CANCELLED"}.
        """
        raise NotImplementedError

    def outline(self, path: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return the line that is drawn meanwhile; by default the path.

        Parameters
        ----------
        path : list of tuple of int
            Positions of the mouse so far, in pixels of the region.

        Returns
        -------
        list of tuple of int
        """
        return path

    def handle_event(
        self, context: Any, event: Any, canvas: PhotoCanvas, position: tuple[int, int]
    ) -> set[str]:
        """Follow press, drag and release of the left mouse button; see `PhotoOperator`.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            Event of the mouse or keyboard.
        canvas : PhotoCanvas
            Where the photo is drawn.
        position : tuple of int
            Of the mouse.

        Returns
        -------
        set of str
            {"RUNNING_MODAL"} or {"PASS_THROUGH"} while waiting; as of `finish` at the release.
        """
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            self._path = [position]
        elif self._path is None:
            return {"PASS_THROUGH"}  # so that the view can still be moved
        elif event.type == "MOUSEMOVE":
            self._path.append(position)
            canvas.redraw()
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            return self.finish(context, canvas, [*self._path, position])
        return {"RUNNING_MODAL"}

    def draw_over(self) -> None:
        """Draw the line; see `PhotoOperator`."""
        if self._path is None or len(self._path) < 2:
            return
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        shader.uniform_float("color", _LINE_COLOR)
        places = [(x, y, 0.0) for x, y in self.outline(self._path)]
        gpu.state.line_width_set(self.line_width)
        batch_for_shader(shader, "LINE_STRIP", {"pos": places}).draw(shader)
        gpu.state.line_width_set(1.0)


class StrokeOnPhoto(DragOnPhoto):
    """An operator that waits for a click or a stroke on the photo, over which the mask is shown."""

    line_width = 3.0

    def use_points(self, settings: Any, points: Sequence[str]) -> None:
        """Use the points of the stroke; the operator's own.

        Parameters
        ----------
        settings : ISC_PG_settings
            Of the scene.
        points : sequence of str
            Columns and rows, such as "120,80"; at least one.
        """
        raise NotImplementedError

    def mask_to_show(self, settings: Any) -> Any:
        """Return the mask of the panel; see `PhotoOperator`.

        Parameters
        ----------
        settings : ISC_PG_settings
            Of the scene.

        Returns
        -------
        bpy.types.Image or None
        """
        return settings.mask if settings.mask_source == "IMAGE" else None

    def finish(self, context: Any, canvas: PhotoCanvas, path: list[tuple[int, int]]) -> set[str]:
        """Use points along the path; see `DragOnPhoto`.

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
            {"CANCELLED"} if all of it lies beside the photo.
        """
        pixels = [point_at(canvas.place(position), self._size) for position in path]
        self._leave(context, set())
        points = points_along([pixel for pixel in pixels if pixel is not None], self._size)
        if not points:
            self.report({"WARNING"}, OUTSIDE)
            return {"CANCELLED"}
        self.use_points(context.scene.isc, [f"{x},{y}" for x, y in points])
        return {"FINISHED"}


def points_along(path: Sequence[tuple[int, int]], size: tuple[int, ...]) -> list[tuple[int, int]]:
    """Choose points along a stroke.

    Parameters
    ----------
    path : sequence of (column, row)
        Pixels that the stroke passes; they may lie far apart, as of a fast mouse.
    size : tuple of int
        Width and height of the photo.

    Returns
    -------
    list of (column, row)
        Pixels on the stroke, at equal distances along it.
    """
    if not path:
        return []
    steps = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(path)]
    gone = np.concatenate([[0.0], np.cumsum(steps)])
    count = min(_MAX_POINTS, 1 + int(gone[-1] / (_SPACING * max(size))))
    places = np.linspace(0.0, gone[-1], count)
    columns, rows = (np.interp(places, gone, part) for part in np.array(path, float).T)
    return list(dict.fromkeys((round(x), round(y)) for x, y in zip(columns, rows, strict=True)))


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
