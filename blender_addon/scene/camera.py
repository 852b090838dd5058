"""The photo's camera with the photo's frame, and the photo behind: orthographic, or a pinhole where
its focal length is known. A render of the maps' size matches them pixel by pixel, or one of the
photo's size the photo: the last row and column of maps may reach past the photo.

Equation: with a focal length of f pixels and a frame of w x h, Blender's lens is f / max(w, h) of
the sensor's width, and its shift the distance of the frame's middle from the principal point, over
max(w, h).
"""

import bpy
import numpy as np
from mathutils import Matrix

from ..datablocks.mesh import metres_per_pixel, to_blender
from ..datablocks.provenance import datablock_name, find_tagged, tag
from ..files.result_arrays import ResultArrays
from .collection import link_object

_PHOTO = "isc_background"
_SENSOR = 36.0  # millimetres: Blender's usual sensor


def ensure_camera(
    key: str,
    collection: bpy.types.Collection,
    result: ResultArrays,
    size_metres: float,
    transform: Matrix | None = None,
    photo_frame: bool = False,
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
        Transform of the object; at the world origin if None. Of an uneven scale, the one across the
        view counts.
    photo_frame : bool, optional
        Whether the frame is the photo's instead of that of the maps.

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
    if not camera.users_collection:  # users may have moved it to another one
        link_object(camera, collection)
    frame = _photo_frame(result) if photo_frame else result.size
    fit = _fit_orthographic if result.focal_length is None else _fit_pinhole
    location, rotation, scale = (transform or Matrix()).decompose()
    across = abs(scale.x * scale.z) ** 0.5 or 1.0
    position = fit(camera.data, result, metres_per_pixel(result, size_metres) * across, frame)
    place = Matrix.LocRotScale(location, rotation, None)
    # Not its basis: users may have given it a parent.
    camera.matrix_world = (
        place @ Matrix.Translation(position) @ Matrix.Rotation(0.5 * np.pi, 4, "X")
    )
    return camera


def eye_of(result: ResultArrays, size_metres: float) -> np.ndarray | None:
    """Return the place of a pinhole camera.

    Parameters
    ----------
    result : ResultArrays
        The result.
    size_metres : float
        Longer side of the object.

    Returns
    -------
    (3,) ndarray or None
        Metres in Blender's axes, from the object's origin; None for an orthographic view.
    """
    if result.eye is None:
        return None
    scale = metres_per_pixel(result, size_metres) / result.metres_per_pixel
    return to_blender(result.eye.astype(float)) * scale


def _photo_frame(result: ResultArrays) -> tuple[float, float]:
    """Width and height of the photo in pixels of the maps, which lie at its upper left corner."""
    width, height = result.photo_size.astype(float) * result.crop_scale
    whole = max(abs(width - result.size[0]), abs(height - result.size[1])) <= 1
    return (float(width), float(height)) if whole else result.size


def _fit_orthographic(
    data: bpy.types.Camera, result: ResultArrays, step: float, frame: tuple[float, float]
) -> tuple[float, float, float]:
    """Set lens and clipping for pixels of `step` metres; the camera's place."""
    (width, height), (column, row) = frame, result.origin_in_frame
    # Far enough for everything in the frame: the object's own depth, and objects beside it.
    distance = (
        4 * max(width, height) * step
        + float(result.vertices[:, 2].max()) * step / result.metres_per_pixel
    )
    position = ((0.5 * (width - 1) - column) * step, -distance, (row - 0.5 * (height - 1)) * step)
    data.type, data.sensor_fit, data.ortho_scale = "ORTHO", "AUTO", max(width, height) * step
    data.shift_x = data.shift_y = 0.0
    data.clip_start, data.clip_end = 0.01 * distance, 3 * distance
    return position


def _fit_pinhole(
    data: bpy.types.Camera, result: ResultArrays, step: float, frame: tuple[float, float]
) -> tuple[float, float, float]:
    """Set lens, shift and clipping for pixels of `step` metres; the camera's place."""
    assert result.camera is not None
    assert result.eye is not None
    seen = result.camera.moved(*result.part.corner)
    (width, height), (x, y) = frame, seen.principal_point
    longest = max(width, height)
    data.type, data.sensor_fit, data.sensor_width = "PERSP", "AUTO", _SENSOR
    data.lens = _SENSOR * seen.focal_length / longest
    data.shift_x, data.shift_y = (0.5 * width - x) / longest, (y - 0.5 * height) / longest
    right, behind, up = to_blender(result.eye.astype(float)) * (step / result.metres_per_pixel)
    data.clip_start, data.clip_end = -0.01 * behind, -10 * behind
    return float(right), float(behind), float(up)


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


def set_background_photo(camera: bpy.types.Object, photo: bpy.types.Image) -> None:
    """Show a photo behind the object in the camera view; the user's other images stay.

    Parameters
    ----------
    camera : bpy.types.Object
        The camera.
    photo : bpy.types.Image
        The photo; it replaces the one that ISC has set before.
    """
    images = camera.data.background_images
    before = camera.data.get(_PHOTO)
    background = (
        next((entry for entry in images if entry.image in (photo, before) and entry.image), None)
        or images.new()
    )
    background.source, background.image, background.alpha = "IMAGE", photo, 1.0
    background.display_depth, background.frame_method = "BACK", "STRETCH"
    camera.data.show_background_images, camera.data[_PHOTO] = True, photo
