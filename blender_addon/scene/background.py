"""The photo behind the object, in the camera's view."""

import bpy

from .provenance import is_isc


def show_photo(camera: bpy.types.Object, photo: bpy.types.Image) -> None:
    """Shows the image as the camera's background, filling its frame. Only the background that ISC put there before is replaced."""
    pictures = camera.data.background_images
    shown = next((one for one in pictures if one.image == photo), None)
    shown = shown or next((one for one in pictures if one.image is None or is_isc(one.image)), None) or pictures.new()
    shown.source, shown.image, shown.display_depth, shown.frame_method, shown.alpha = "IMAGE", photo, "BACK", "STRETCH", 1.0
    camera.data.show_background_images = True
