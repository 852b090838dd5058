"""The photo's camera: orthographic, its frame the photo's, pixel by pixel where the render has the
size of the maps.
"""

import bpy
import numpy as np
from mathutils import Matrix

from ..files.result_arrays import Result
from .collection import put
from .mesh import metres_per_pixel
from .provenance import find, label, mark


def ensure_camera(
    key: str,
    collection: bpy.types.Collection,
    result: Result,
    size_metres: float,
    where: Matrix | None = None,
) -> bpy.types.Object:
    """The camera before the object.

    `where`: the object's place, its rotation and location count; the world's origin if None.
    """
    camera = find(bpy.data.objects, key, "camera")
    if camera is None:
        data = mark(bpy.data.cameras.new(label(key, "camera")), key, "camera")
        camera = mark(bpy.data.objects.new(label(key, "camera"), data), key, "camera")
    put(camera, collection)
    (width, height), step = result.size, metres_per_pixel(result, size_metres)
    column, row, _ = result.origin.astype(float)
    # Behind everything that can stand in the frame: the object's own depth, and room for what
    # people put beside it.
    distance = (
        4 * max(width, height) * step
        + float(result.vertices[:, 2].max()) * step / result.metres_per_pixel
    )
    middle = ((0.5 * (width - 1) - column) * step, -distance, (row - 0.5 * (height - 1)) * step)
    data = camera.data
    data.type, data.sensor_fit, data.ortho_scale = "ORTHO", "AUTO", max(width, height) * step
    data.shift_x, data.shift_y, data.clip_start, data.clip_end = (
        0.0,
        0.0,
        0.01 * distance,
        3 * distance,
    )
    place = Matrix.LocRotScale(*where.decompose()[:2], None) if where is not None else Matrix()
    camera.matrix_basis = place @ Matrix.Translation(middle) @ Matrix.Rotation(0.5 * np.pi, 4, "X")
    return camera


def frame_as_photo(scene: bpy.types.Scene, size: tuple[int, int]) -> None:
    """Makes the render's size that of the maps: width and height in pixels."""
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.pixel_aspect_x, render.pixel_aspect_y, render.use_border = 1.0, 1.0, False
