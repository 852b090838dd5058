"""The photo under the mouse: as an image editor shows it, or drawn over the 3D view.

Over the 3D view, the photo fills as much of the region as its aspect ratio allows, with a margin;
the scene stays visible around it.

Limits: the photo over the 3D view cannot be zoomed: use an image editor for small objects.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import bpy
import gpu  # type: ignore[import-not-found]
from gpu_extras.batch import batch_for_shader  # type: ignore[import-not-found]

_FILL = 0.9  # of the region, along the side that limits the photo
_EDITORS = {"VIEW_3D": "SpaceView3D", "IMAGE_EDITOR": "SpaceImageEditor"}
_MASK_TINT = (0.4, 0.0, 0.0, 0.5)  # of what the mask excludes

Point = tuple[float, float]


class PhotoCanvas:
    """Mouse positions on a photo, and drawing over it, until `close`.

    The region is looked up whenever it is needed: the user may close the area, or load another
    file, and Blender then frees it.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context, of a 3D view or an image editor.
    photo : bpy.types.Image
        The photo.
    draw : callable, optional
        Draws over the photo, in pixels of the region.
    mask : bpy.types.Image, optional
        A mask: what it excludes is tinted.
    """

    def __init__(
        self,
        context: Any,
        photo: Any,
        draw: Callable[[], None] | None = None,
        mask: Any = None,
    ) -> None:
        # The button may be in the sidebar: the region is that of the view.
        region = next(part for part in context.area.regions if part.type == "WINDOW")
        self._address = region.as_pointer()
        self._kind: str = context.area.type
        self._size: tuple[int, int] = tuple(photo.size)
        self._draw_over = draw
        self._texture = gpu.texture.from_image(photo) if self._kind == "VIEW_3D" else None
        self._mask = None if mask is None else gpu.texture.from_image(mask)
        self._space = getattr(bpy.types, _EDITORS[self._kind])
        self._handler = self._space.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")
        region.tag_redraw()

    def position(self, event: Any) -> tuple[int, int] | None:
        """Return where the mouse is, in pixels of the region.

        Parameters
        ----------
        event : bpy.types.Event
            Its position is in pixels of the window.

        Returns
        -------
        tuple of int or None
            None if the region is gone.
        """
        _, region = self._find()
        return None if region is None else (event.mouse_x - region.x, event.mouse_y - region.y)

    def place(self, position: tuple[int, int]) -> Point:
        """Return the place of the photo that is at a position.

        Parameters
        ----------
        position : tuple of int
            As `position` returns it.

        Returns
        -------
        tuple of float
            (0, 0) is the photo's lower left corner, (1, 1) its upper right one.
        """
        area, region = self._find()
        if region is None:
            return -1.0, -1.0
        if self._kind != "VIEW_3D":
            view: Point = region.view2d.region_to_view(*position)
            return view
        left, bottom, width, height = fit_rectangle(self._size, _free_size(area, region))
        return (position[0] - left) / width, (position[1] - bottom) / height

    def redraw(self) -> None:
        """Draw again."""
        _, region = self._find()
        if region is not None:
            region.tag_redraw()

    def close(self) -> None:
        """Stop drawing. Does nothing the second time."""
        if self._handler is not None:
            self._space.draw_handler_remove(self._handler, "WINDOW")
            self._handler = self._texture = self._mask = None
            self.redraw()

    def _find(self) -> tuple[Any, Any]:
        """Area and region, or None and None if they are gone."""
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                for region in area.regions if area.type == self._kind else ():
                    if region.as_pointer() == self._address:
                        return area, region
        return None, None

    def _draw(self) -> None:
        area, region = bpy.context.area, bpy.context.region
        if region.as_pointer() != self._address:  # another view of the same kind
            return
        corners = self._corners(area, region)
        if self._texture is not None:
            _draw_texture(_image_shader(), self._texture, corners)
        if self._mask is not None:
            shader = _tint_shader()
            gpu.state.blend_set("ALPHA")
            shader.uniform_float("tint", _MASK_TINT)
            _draw_texture(shader, self._mask, corners)
            gpu.state.blend_set("NONE")
        if self._draw_over is not None:
            self._draw_over()

    def _corners(self, area: Any, region: Any) -> tuple[Point, Point]:
        """Lower left and upper right corner of the photo, in pixels of the region."""
        if self._kind != "VIEW_3D":
            first, last = (region.view2d.view_to_region(end, end, clip=False) for end in (0.0, 1.0))
            return first, last
        left, bottom, width, height = fit_rectangle(self._size, _free_size(area, region))
        return (left, bottom), (left + width, bottom + height)


def _draw_texture(shader: Any, texture: Any, corners: tuple[Point, Point]) -> None:
    (left, bottom), (right, top) = corners
    places = ((left, bottom), (right, bottom), (right, top), (left, top))
    shader.uniform_sampler("image", texture)
    sheet = {"pos": places, "texCoord": ((0, 0), (1, 0), (1, 1), (0, 1))}
    batch_for_shader(shader, "TRI_FAN", sheet).draw(shader)


@cache
def _tint_shader() -> Any:
    """A shader that lays a color over what is black in an image."""
    info, passed = gpu.types.GPUShaderCreateInfo(), gpu.types.GPUStageInterfaceInfo("isc_tint")
    passed.smooth("VEC2", "place")
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.push_constant("VEC4", "tint")
    info.sampler(0, "FLOAT_2D", "image")
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_in(1, "VEC2", "texCoord")
    info.vertex_out(passed)
    info.fragment_out(0, "VEC4", "color")
    info.vertex_source(
        "void main() {"
        " place = texCoord;"
        " gl_Position = ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0); }"
    )
    info.fragment_source(
        "void main() {"
        " color = vec4(tint.rgb, tint.a * (1.0 - clamp(texture(image, place).r, 0.0, 1.0))); }"
    )
    return gpu.shader.create_from_info(info)


def _free_size(area: Any, region: Any) -> tuple[int, int]:
    """Width and height of a region, without the sidebar that lies over its right part."""
    edges = [part.x for part in area.regions if part.type == "UI" and part.width > 1]
    return min([region.x + region.width, *edges]) - region.x, region.height


def _image_shader() -> Any:
    """The shader that shows an image's colours as they are, which older Blenders lack."""
    try:
        return gpu.shader.from_builtin("IMAGE_SCENE_LINEAR_TO_REC709_SRGB")
    except ValueError:
        return gpu.shader.from_builtin("IMAGE")


def fit_rectangle(
    size: tuple[int, int], available: tuple[int, int]
) -> tuple[float, float, float, float]:
    """Fit a photo into a region.

    Parameters
    ----------
    size : tuple of int
        Width and height of the photo.
    available : tuple of int
        Width and height of the free part of the region, from its lower left corner.

    Returns
    -------
    tuple of float
        Left, bottom, width and height in pixels of the region.
    """
    scale = _FILL * min(available[0] / size[0], available[1] / size[1])
    width, height = scale * size[0], scale * size[1]
    return (available[0] - width) / 2, (available[1] - height) / 2, width, height
