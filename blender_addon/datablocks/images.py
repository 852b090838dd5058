"""Maps and textures as Blender images, packed into the file, in the right colour space.

Blender counts rows from below, the maps from above. Maps are float32: colours "Linear Rec.709",
everything else "Non-Color", so that the values are used unchanged; packed, they are 32-bit OpenEXR,
and saving the file loses nothing. Textures are what other programs read: PNG of 8 bits, colours
coded as sRGB, everything else "Non-Color". Exporters name files by the images' names.
"""

import bpy
import numpy as np

from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb, srgb_to_linear
from isc_core.io.png import encode_png

from ..files.result_arrays import ResultArrays
from .provenance import datablock_name, find_tagged, tag

COLOR, DATA, SRGB = "Linear Rec.709", "Non-Color", "sRGB"
_FAST = 1  # compression of large textures
# Names of the textures in files, by role.
TEXTURE_NAMES = {
    "base_color": "basecolor",
    "edited_base_color": "basecolor_edited",
    "normal_map": "normal",
    "specular_variation": "specular",
}
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
    return _put_in_place(image, key, role)


def ensure_texture(key: str, role: str, values: np.ndarray, space: str) -> bpy.types.Image:
    """Create a texture, or replace the one of that role everywhere it is used.

    Parameters
    ----------
    key : str
        Name of the photo.
    role : str
        One of `TEXTURE_NAMES`.
    values : (H, W) or (H, W, 3) ndarray
        Pixels in [0, 1], row 0 at the top; others are clipped. Colours are linear Rec.709.
    space : str
        `SRGB` for colours, else `DATA`.

    Returns
    -------
    bpy.types.Image
        The packed image.
    """
    return _put_in_place(new_texture(key, role, values[::-1], space), key, role)


def ensure_png_texture(key: str, role: str, data: bytes) -> bpy.types.Image:
    """Create a texture of a PNG file, or replace the one of that role everywhere it is used.

    Parameters
    ----------
    key, role : str
        As of `ensure_texture`.
    data : bytes
        The file; it has sRGB codes.

    Returns
    -------
    bpy.types.Image
        The packed image.
    """
    return _put_in_place(new_png_texture(key, role, data), key, role)


def new_png_texture(key: str, role: str, data: bytes) -> bpy.types.Image:
    """Create a packed texture of a PNG file; Blender reads its pixels when it needs them.

    Parameters
    ----------
    key, role, data : str, str, bytes
        As of `ensure_png_texture`.

    Returns
    -------
    bpy.types.Image
        The image, without a tag.
    """
    image = bpy.data.images.new(_texture_name(key, role), 1, 1)
    image.colorspace_settings.name = SRGB
    image.file_format = "PNG"
    image.pack(data=data, data_len=len(data))
    image.source = "FILE"
    return image


def scaled_png(codes: np.ndarray, gain: float) -> bytes:
    """Return a PNG file of colours times a factor.

    Parameters
    ----------
    codes : (H, W, 3) ndarray of uint8
        sRGB, row 0 at the top.
    gain : float
        Factor of the linear values; they are clipped at 1.

    Returns
    -------
    bytes
        The file, in sRGB.
    """
    linear = gain * srgb_to_linear(np.arange(256) / 255)
    table = np.rint(255 * linear_to_srgb(np.clip(linear, 0, 1))).astype(np.uint8)
    return encode_png(table[codes], _FAST)


def new_texture(key: str, role: str, values: np.ndarray, space: str) -> bpy.types.Image:
    """Create a packed texture of 8 bits.

    Parameters
    ----------
    key, role, space : str
        As of `ensure_texture`.
    values : (H, W) or (H, W, 3) ndarray
        As of `ensure_texture`, but row 0 at the bottom. A map of single values is stored in alpha,
        too, where glTF has the specular level.

    Returns
    -------
    bpy.types.Image
        The image, without a tag.
    """
    rows, columns = values.shape[:2]
    image = bpy.data.images.new(_texture_name(key, role), columns, rows, alpha=values.ndim == 2)
    image.colorspace_settings.name = space
    shares = np.clip(values, 0, 1)
    pixels = np.ones((rows, columns, 4), np.float32)
    if values.ndim == 2:
        pixels[:] = shares[..., None]
        image.alpha_mode = "CHANNEL_PACKED"
    else:
        pixels[..., :3] = linear_to_srgb(shares) if space == SRGB else shares
    image.pixels.foreach_set(pixels.ravel())
    image.file_format = "PNG"
    image.pack()
    return image


def _texture_name(key: str, role: str) -> str:
    """The name of an image, from which exporters make that of its file."""
    return datablock_name(key, TEXTURE_NAMES[role], "_")


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


def _put_in_place(image: bpy.types.Image, key: str, role: str) -> bpy.types.Image:
    """Tag a new image, which replaces the one of that role everywhere it is used.

    A generated image loses its pixels when resized in place, so it is replaced instead.
    """
    old = find_tagged(bpy.data.images, key, role)
    if old is not None:
        name = old.name
        old.user_remap(image)
        bpy.data.images.remove(old)
        image.name = name
    return tag(image, key, role)
