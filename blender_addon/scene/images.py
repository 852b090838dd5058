"""Maps as Blender images: float32, packed into the file, in the right colour space.

Blender counts rows from below; our maps from above. Colours are "Linear Rec.709", everything else
"Non-Color": their values are used as they are. A packed image is an OpenEXR of 32 bit, so that
nothing is lost by saving.
"""

import bpy
import numpy as np

from isc_core.errors import InputError

from ..files.result_arrays import Result
from .provenance import find, label, mark

COLOR, DATA = "Linear Rec.709", "Non-Color"
MAPS = {
    **dict.fromkeys(("diffuse", "specular", "residual", "reflectance", "shading", "lobe"), COLOR),
    **dict.fromkeys(("normal", "height", "confidence", "mask"), DATA),
}


def require_spaces(*names: str) -> None:
    """Raises `InputError` where Blender runs with somebody's colour configuration that lacks one of
    the colour spaces.
    """
    known = bpy.types.ColorManagedInputColorspaceSettings.bl_rna.properties[
        "name"
    ].enum_items.keys()
    if missing := [name for name in names if name not in known]:
        raise InputError(
            f"the colour configuration has no space {missing[0]!r}: start Blender with its own (without the variable OCIO)"
        )


def ensure_image(
    key: str, role: str, values: np.ndarray, space: str, alpha: np.ndarray | None = None
) -> bpy.types.Image:
    """The image of that role with these values:

    (H, W) or (H, W, 3); `alpha`: (H, W) in [0, 1], 1 if None.
    """
    rows, columns = values.shape[:2]
    old = find(bpy.data.images, key, role)
    image = bpy.data.images.new(
        label(key, role.replace("_", " ")),
        columns,
        rows,
        alpha=alpha is not None,
        float_buffer=True,
    )
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


def ensure_maps(key: str, result: Result) -> dict[str, bpy.types.Image]:
    """All maps of the result as images, by name."""
    return {
        name: ensure_image(key, name, getattr(result, name), space) for name, space in MAPS.items()
    }


def attach_maps(thing: bpy.types.Object, maps: dict[str, bpy.types.Image]) -> None:
    """Lets the object's properties `isc_map_...` point at the images, so that they are saved and
    appended with it.
    """
    for name, image in maps.items():
        thing[f"isc_map_{name}"] = image


def _replace(old: bpy.types.Image, new: bpy.types.Image) -> None:
    """Puts `new` wherever `old` is used, under its name; a generated image cannot change its size
    in place without losing its pixels.
    """
    name = old.name
    old.user_remap(new)
    bpy.data.images.remove(old)
    new.name = name
