"""Maps as Blender images: float32, packed into the file, in the right colour space.

Blender counts rows from below, the maps from above. Colours are "Linear Rec.709", everything else
"Non-Color": the values are used unchanged. A packed image is a 32-bit OpenEXR, so saving the file
loses nothing.
"""

import bpy
import numpy as np

from isc_core.errors import InputError

from ..files.result_arrays import ResultArrays
from .provenance import datablock_name, find_tagged, tag

COLOR, DATA = "Linear Rec.709", "Non-Color"
MAPS = {
    **dict.fromkeys(("diffuse", "specular", "residual", "reflectance", "shading", "lobe"), COLOR),
    **dict.fromkeys(("normal", "height", "confidence", "mask"), DATA),
}


# What materials and exports need; the others are for those who want them.
USED_MAPS = ("specular", "height", "mask")


def require_color_spaces(*names: str) -> None:
    """Check that Blender knows some colour spaces.

    Parameters
    ----------
    *names : str
        Names of colour spaces.

    Raises
    ------
    InputError
        If a custom colour configuration lacks one.
    """
    known = bpy.types.ColorManagedInputColorspaceSettings.bl_rna.properties[
        "name"
    ].enum_items.keys()
    if missing := [name for name in names if name not in known]:
        raise InputError(
            f"the colour configuration has no space {missing[0]!r}: "
            "start Blender with its own configuration (without the variable OCIO)"
        )


def ensure_image(
    key: str, role: str, values: np.ndarray, space: str, alpha: np.ndarray | None = None
) -> bpy.types.Image:
    """Create an image, or replace the one of that role everywhere it is used.

    Parameters
    ----------
    key : str
        Name of the photo.
    role : str
        Purpose of the image.
    values : (H, W) or (H, W, 3) ndarray
        Pixels, row 0 at the top.
    space : str
        Name of the colour space.
    alpha : (H, W) ndarray, optional
        Alpha in [0, 1]; opaque if None.

    Returns
    -------
    bpy.types.Image
        The packed image.
    """
    rows, columns = values.shape[:2]
    old = find_tagged(bpy.data.images, key, role)
    image = bpy.data.images.new(
        datablock_name(key, role.replace("_", " ")),
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
    return tag(image, key, role)


def ensure_maps(key: str, result: ResultArrays, every: bool = True) -> dict[str, bpy.types.Image]:
    """Create or replace the images of maps.

    Parameters
    ----------
    key : str
        Name of the photo.
    result : ResultArrays
        The result.
    every : bool, optional
        Whether all of `MAPS` are created, or those of `USED_MAPS`; the others are then removed.

    Returns
    -------
    dict of str to bpy.types.Image
        The images by map name.
    """
    maps = {}
    for name, space in MAPS.items():
        if every or name in USED_MAPS:
            maps[name] = ensure_image(key, name, getattr(result, name), space)
        elif (old := find_tagged(bpy.data.images, key, name)) is not None:
            bpy.data.images.remove(old)  # of an earlier result
    return maps


def attach_maps(obj: bpy.types.Object, maps: dict[str, bpy.types.Image]) -> None:
    """Store the images as custom properties, so that they are saved and appended with the object.

    Parameters
    ----------
    obj : bpy.types.Object
        The object; gets the properties `isc_map_...`, and loses those of other maps.
    maps : dict of str to bpy.types.Image
        The images by map name.
    """
    for name in MAPS:
        if name in maps:
            obj[f"isc_map_{name}"] = maps[name]
        elif f"isc_map_{name}" in obj:
            del obj[f"isc_map_{name}"]


def _replace(old: bpy.types.Image, new: bpy.types.Image) -> None:
    """A generated image loses its pixels when resized in place, so it is replaced instead."""
    name = old.name
    old.user_remap(new)
    bpy.data.images.remove(old)
    new.name = name
