"""The photo's camera: orthographic, with the frame of the photo. A render of the maps' size matches
them pixel by pixel.
"""

import bpy
import numpy as np
from mathutils import Matrix

from ..files.result_arrays import ResultArrays
from .collection import link_object
from .mesh import metres_per_pixel
from .provenance import datablock_name, find_tagged, tag


def ensure_camera(
    key: str,
    collection: bpy.types.Collection,
    result: ResultArrays,
    size_metres: float,
    transform: Matrix | None = None,
) -> bpy.types.Object:
    """Create or update the camera in front of the object.

    Parameters
    ----------
    key : str
        Name of the photo.
    collection : bpy.types.Collection
        Collection of the camera.
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.
    transform : Matrix, optional
        Transform of the object, of which location and rotation are used; at the world origin if
        None.

    Returns
    -------
    bpy.types.Object
        The camera.
    """
    camera = find_tagged(bpy.data.objects, key, "camera")
    if camera is None:
        name = datablock_name(key, "camera")
        data = tag(bpy.data.cameras.new(name), key, "camera")
        camera = tag(bpy.data.objects.new(name, data), key, "camera")
    link_object(camera, collection)
    (width, height), step = result.size, metres_per_pixel(result, size_metres)
    column, row, _ = result.origin.astype(float)
    # Far enough for everything in the frame: the object's own depth, and objects beside it.
    distance = (
        4 * max(width, height) * step
        + float(result.vertices[:, 2].max()) * step / result.metres_per_pixel
    )
    position = ((0.5 * (width - 1) - column) * step, -distance, (row - 0.5 * (height - 1)) * step)
    data = camera.data
    data.type, data.sensor_fit, data.ortho_scale = "ORTHO", "AUTO", max(width, height) * step
    data.shift_x = data.shift_y = 0.0
    data.clip_start, data.clip_end = 0.01 * distance, 3 * distance
    place = Matrix() if transform is None else Matrix.LocRotScale(*transform.decompose()[:2], None)
    camera.matrix_basis = (
        place @ Matrix.Translation(position) @ Matrix.Rotation(0.5 * np.pi, 4, "X")
    )
    return camera


def set_render_size(scene: bpy.types.Scene, size: tuple[int, int]) -> None:
    """Set the resolution of a scene's renders.

    Parameters
    ----------
    scene : bpy.types.Scene
        The scene.
    size : tuple of int
        Width and height in pixels.
    """
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.pixel_aspect_x, render.pixel_aspect_y, render.use_border = 1.0, 1.0, False
