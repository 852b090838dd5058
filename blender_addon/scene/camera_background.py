"""The photo behind the object, in the camera's view."""

import bpy

_SHOWN = "isc_background"


def show_photo(camera: bpy.types.Object, photo: bpy.types.Image) -> None:
    """Shows the image as the camera's background, filling its frame.

    Only the one that ISC put there before is replaced.
    """
    pictures = camera.data.background_images
    before = camera.data.get(_SHOWN)
    ours = (
        next(
            (one for one in pictures if one.image in (photo, before) and one.image is not None),
            None,
        )
        or pictures.new()
    )
    ours.source, ours.image, ours.display_depth, ours.frame_method, ours.alpha = (
        "IMAGE",
        photo,
        "BACK",
        "STRETCH",
        1.0,
    )
    camera.data.show_background_images, camera.data[_SHOWN] = True, photo
