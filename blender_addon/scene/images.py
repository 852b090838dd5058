"""Maps as Blender images: float32, packed into the file, in the right colour space.

Blender counts rows from below; our maps from above. Colours are "Linear Rec.709", everything else "Non-Color": their values are used as
they are. A packed image is an OpenEXR of 32 bit, so that nothing is lost by saving.
"""

import bpy
import numpy as np

from .provenance import find, label, mark

COLOR, DATA = "Linear Rec.709", "Non-Color"


def ensure_image(key: str, role: str, values: np.ndarray, space: str, alpha: np.ndarray | None = None) -> bpy.types.Image:
    """The image of that role with these values: (H, W) or (H, W, 3); `alpha`: (H, W) in [0, 1], 1 if None."""
    rows, columns = values.shape[:2]
    old = find(bpy.data.images, key, role)
    image = bpy.data.images.new(label(key, role.replace("_", " ")), columns, rows, alpha=alpha is not None, float_buffer=True)
    image.colorspace_settings.name = space
    pixels = np.ones((rows, columns, 4), np.float32)
    pixels[..., :3] = (values if values.ndim == 3 else values[..., None])[::-1]
    if alpha is not None:
        pixels[..., 3] = alpha[::-1]
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    if old is not None:
        _replace(old, image)
    return mark(image, key, role)


def _replace(old: bpy.types.Image, new: bpy.types.Image) -> None:
    """Puts `new` wherever `old` is used, under its name; a generated image cannot change its size in place without losing its pixels."""
    name = old.name
    old.user_remap(new)
    bpy.data.images.remove(old)
    new.name = name
