"""Maps and textures as Blender images, packed into the file, in the right colour space.

Blender counts rows from below, the maps from above. Maps are float32: colours "Linear Rec.709",
everything else "Non-Color", so that the values are used unchanged; packed, they are 32-bit OpenEXR,
and saving the file loses nothing. Textures are what other programs read: PNG of 8 bits, colours
coded as sRGB, everything else "Non-Color". Exporters name files by the images' names.

Files are encoded here, in any thread, and not by Blender, which takes seconds for large images and
does it while the window waits. Blender decodes one when it is drawn for the first time.
"""

from dataclasses import dataclass, field
from enum import StrEnum

import bpy
import numpy as np

from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb, srgb_codes, srgb_to_linear
from isc_core.io.png import encode_png

from ..files.checksums import crc32_of
from ..files.exr import encode_exr
from .provenance import KEY, ROLE, all_tagged, datablock_name, is_isc_datablock, tag

COLOR, DATA, SRGB = "Linear Rec.709", "Non-Color", "sRGB"
_FAST = 1  # compression of large textures
_CHECKSUM = "isc_file_crc32"


class ImageRole(StrEnum):
    """Purpose of an image of an object. The values are in files: see `provenance`.

    Attributes
    ----------
    BASE_COLOR, PLAIN_BASE_COLOR, EDITED_BASE_COLOR
        Textures: with the gloss of the photo, without gloss, with the user's edits.
    NORMAL_MAP, SPECULAR_VARIATION, ALPHA
        Other textures of the material.
    VIEW_NORMAL
        Normals in the photo's view, from which edits of the gloss compute a base color.
    DISPLACEMENT, ENVIRONMENT_MAP, PHOTO
        Of the displaced mesh, the world and the camera's background.
    DIFFUSE, SPECULAR, RESIDUAL, REFLECTANCE, SHADING, LOBE, NORMAL, HEIGHT, CONFIDENCE, MASK
        Maps of the result, by their names in it.
    """

    BASE_COLOR = "base_color"
    PLAIN_BASE_COLOR = "plain_base_color"
    EDITED_BASE_COLOR = "edited_base_color"
    NORMAL_MAP = "normal_map"
    SPECULAR_VARIATION = "specular_variation"
    ALPHA = "alpha"
    VIEW_NORMAL = "view_normal"
    DISPLACEMENT = "displacement"
    ENVIRONMENT_MAP = "environment_map"
    PHOTO = "photo"
    DIFFUSE = "diffuse"
    SPECULAR = "specular"
    RESIDUAL = "residual"
    REFLECTANCE = "reflectance"
    SHADING = "shading"
    LOBE = "lobe"
    NORMAL = "normal"
    HEIGHT = "height"
    CONFIDENCE = "confidence"
    MASK = "mask"


# Names of the textures in files.
TEXTURE_NAMES = {
    ImageRole.BASE_COLOR: "basecolor",
    ImageRole.PLAIN_BASE_COLOR: "basecolor_plain",
    ImageRole.EDITED_BASE_COLOR: "basecolor_edited",
    ImageRole.NORMAL_MAP: "normal",
    ImageRole.SPECULAR_VARIATION: "specular",
    ImageRole.ALPHA: "alpha",
}
# The maps of a result, with their colour spaces.
MAPS = {
    ImageRole.DIFFUSE: COLOR,
    ImageRole.SPECULAR: COLOR,
    ImageRole.RESIDUAL: COLOR,
    ImageRole.REFLECTANCE: COLOR,
    ImageRole.SHADING: COLOR,
    ImageRole.LOBE: COLOR,
    ImageRole.NORMAL: DATA,
    ImageRole.HEIGHT: DATA,
    ImageRole.CONFIDENCE: DATA,
    ImageRole.MASK: DATA,
}
# Maps that materials and exports need; the others are optional.
USED_MAPS = (ImageRole.SPECULAR, ImageRole.HEIGHT, ImageRole.MASK)


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
            f"the color configuration has no space {missing[0]!r}: "
            "start Blender with its own configuration (without the variable OCIO)"
        )


@dataclass(frozen=True)
class ImageFile:
    """The file of an image.

    Attributes
    ----------
    data : bytes
        PNG or OpenEXR.
    space : str
        Name of the colour space.
    is_png : bool
        Whether it is PNG.
    alpha_is_data : bool
        Whether alpha is a data channel and not opacity.
    checksum : str
        CRC-32 of the data, hexadecimal, as Blender's integer properties are signed.
    """

    data: bytes
    space: str
    is_png: bool = True
    alpha_is_data: bool = False
    checksum: str = field(init=False)

    def __post_init__(self) -> None:
        # Computed here, in the thread that encodes: it takes as long as packing a large map.
        object.__setattr__(self, "checksum", crc32_of(self.data))


def map_file(values: np.ndarray, space: str, alpha: np.ndarray | None = None) -> ImageFile:
    """Return the file of a map; this may run in another thread.

    Parameters
    ----------
    values : (H, W) or (H, W, 3) ndarray
        Pixels, row 0 at the top.
    space : str
        Name of the colour space.
    alpha : (H, W) ndarray, optional
        Alpha in [0, 1]; opaque if None.

    Returns
    -------
    ImageFile
        OpenEXR with 32 bits.
    """
    if alpha is not None:
        values = np.concatenate([values, alpha[..., None]], -1)
    return ImageFile(encode_exr(values), space, is_png=False)


def texture_file(values: np.ndarray, space: str) -> ImageFile:
    """Return the file of a texture; this may run in another thread.

    Parameters
    ----------
    values : (H, W) or (H, W, 3) ndarray
        Pixels in [0, 1], row 0 at the top; others are clipped. Colours are linear Rec.709. A map of
        single values is stored in alpha, too, where glTF has the specular level.
    space : str
        `SRGB` for colours, else `DATA`.

    Returns
    -------
    ImageFile
        PNG of 8 bits.
    """
    shares = np.clip(values, 0, 1)
    coded = linear_to_srgb(shares) if space == SRGB else shares
    codes = np.rint(255 * coded).astype(np.uint8)
    if values.ndim == 2:
        codes = np.repeat(codes[..., None], 4, -1)
    return ImageFile(encode_png(codes, _FAST), space, alpha_is_data=values.ndim == 2)


def scaled_file(codes: np.ndarray, gain: float) -> ImageFile:
    """Return the file of colours times a factor; this may run in another thread.

    Parameters
    ----------
    codes : (H, W, 3) ndarray of uint8
        sRGB, row 0 at the top.
    gain : float
        Factor of the linear values; they are clipped at 1.

    Returns
    -------
    ImageFile
        PNG in sRGB.
    """
    table = srgb_codes(gain * srgb_to_linear(np.arange(256) / 255))
    return coded_file(table[codes])


def coded_file(codes: np.ndarray) -> ImageFile:
    """Return the file of colours; this may run in another thread.

    Parameters
    ----------
    codes : (H, W, 3) ndarray of uint8
        sRGB, row 0 at the top.

    Returns
    -------
    ImageFile
        PNG.
    """
    return ImageFile(encode_png(codes, _FAST), SRGB)


def new_image(file: ImageFile) -> bpy.types.Image:
    """Create a packed image; Blender reads its pixels when it needs them.

    Parameters
    ----------
    file : ImageFile
        The file.

    Returns
    -------
    bpy.types.Image
        The image, without a tag or a name of its own.
    """
    image = bpy.data.images.new("isc", 1, 1)
    image.colorspace_settings.name = file.space
    image.file_format = "PNG" if file.is_png else "OPEN_EXR"
    if file.alpha_is_data:
        image.alpha_mode = "CHANNEL_PACKED"
    image.pack(data=file.data, data_len=len(file.data))
    image.source = "FILE"
    image[_CHECKSUM] = file.checksum
    return image


def unmodified_file(image: bpy.types.Image) -> bytes:
    """Return the packed file of an image made by `new_image` that has not been painted on.

    Parameters
    ----------
    image : bpy.types.Image
        Any image.

    Returns
    -------
    bytes
        The file; b"" for other images.
    """
    if _CHECKSUM not in image or image.is_dirty or len(image.packed_files) != 1:
        return b""
    data = bytes(image.packed_file.data)
    return data if crc32_of(data) == image[_CHECKSUM] else b""


def content_mark(image: bpy.types.Image) -> str:
    """Return a text that changes with the content of an image, without reading its pixels.

    Parameters
    ----------
    image : bpy.types.Image
        Any image.

    Returns
    -------
    str
        Equal for equal files. Two strokes of a brush without saving the image in between give the
        same text.
    """
    size = image.packed_file.size if image.packed_file is not None else 0
    painted = " painted" if image.is_dirty else ""
    return f"{image.name} {image.get(_CHECKSUM, '')} {size}{painted}"


def replace_image(image: bpy.types.Image, key: str, role: ImageRole) -> bpy.types.Image:
    """Name and tag an image, and replace the previous one of that role everywhere.

    A generated image loses its pixels when resized in place, so it is replaced instead. A texture
    that the user has painted on stays in the file, see `keep_painted`.

    Parameters
    ----------
    image : bpy.types.Image
        A new image.
    key : str
        Name of the photo.
    role : ImageRole

    Returns
    -------
    bpy.types.Image
        The same image.
    """
    name, old = image_name(key, role), _find_image(key, role)
    if old is not None:
        name = old.name
        old.user_remap(image)
        if role in TEXTURE_NAMES and _CHECKSUM in old and not unmodified_file(old):
            keep_painted(old)
        else:
            bpy.data.images.remove(old)
    image.name = name
    return tag(image, key, role)


def keep_painted(image: bpy.types.Image) -> None:
    """Keep an image that the user has painted on in the file, as the user's own.

    Parameters
    ----------
    image : bpy.types.Image
        The image; loses its tags, and gets "painted" in its name.
    """
    if image.is_dirty:
        image.pack()
    for name in (KEY, ROLE):
        image.pop(name, None)
    image.name, image.use_fake_user = f"{image.name} painted", True


def _find_image(key: str, role: ImageRole) -> bpy.types.Image | None:
    """The image of a role. A duplicate of the user's has the same tags, and another name or no
    user of ISC.
    """
    found = list(all_tagged(bpy.data.images, key, role))
    if len(found) < 2:
        return next(iter(found), None)
    name, users = image_name(key, role), bpy.data.user_map(subset=found)

    def rank(image: bpy.types.Image) -> tuple[bool, bool]:
        return image.name == name, any(is_isc_datablock(user) for user in users.get(image, ()))

    return max(found, key=rank)


def image_name(key: str, role: ImageRole) -> str:
    """Return the name of an image, from which exporters make that of its file.

    Parameters
    ----------
    key : str
        Name of the photo.
    role : ImageRole

    Returns
    -------
    str
        The name.
    """
    if role in TEXTURE_NAMES:
        return datablock_name(key, TEXTURE_NAMES[role], "_")
    return datablock_name(key, role.replace("_", " "))


def attach_maps(obj: bpy.types.Object, maps: dict[ImageRole, bpy.types.Image]) -> None:
    """Store the images as custom properties, so that they are saved and appended with the object.

    Parameters
    ----------
    obj : bpy.types.Object
        The object; gets the properties `isc_map_...`, and loses those of other maps, whose images
        are removed unless something else uses them.
    maps : dict of ImageRole to bpy.types.Image
    """
    for role in MAPS:
        if role in maps:
            obj[f"isc_map_{role}"] = maps[role]
            continue
        old = obj.get(f"isc_map_{role}")  # of an earlier result; None if the user removed it
        if f"isc_map_{role}" in obj:
            del obj[f"isc_map_{role}"]
        if old is not None and old.users == 0:
            bpy.data.images.remove(old)
