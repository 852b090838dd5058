"""The photo as background image of the camera."""

import bpy

_PHOTO = "isc_background"


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
