"""How a Blender image can be handed to the worker, decided before any of its pixels are read.

Problem: an image datablock may be a file, packed, generated, or painted and unsaved; with 8 bits
or float; in any colour space. The worker reads files. An image that equals its file is handed over
as that file, which keeps 16 bits and the file's own colour coding. All others leave Blender as
pixels (see `image_export`).

Limits: byte images in a colour space other than sRGB and linear Rec.709 are refused; Non-Color
counts as linear. Blender ignores the orientation flag of photos and the worker applies it, so files
with such a flag are handed over as pixels: masks painted on them stay aligned. Blender ignores
colour profiles, too; the worker applies that of a file.
"""

import mmap
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mathutils
import numpy as np

from isc_core.errors import InputError
from isc_core.photo.names import UNUSUAL_SUFFIXES

MAX_PIXELS = 100_000_000
MIN_SIDE = 8
_SUFFIXES = {
    b"\x89PNG": ".png",
    b"\xff\xd8\xff": ".jpg",
    b"II*\0": ".tif",
    b"MM\0*": ".tif",
    b"v/1\x01": ".exr",
    b"#?": ".hdr",
    b"BM": ".bmp",
}
_WITH_PROFILE = (".png", ".jpg")
_HEAD_BYTES = 1 << 18  # cameras write the orientation flag near the start
_ORIENTATION_TAG = 0x0112
_LINEAR_SPACES = ("Linear Rec.709", "Linear")
_UNSUPPORTED_SOURCES = {
    "MOVIE": "is a movie: save one frame of it as an image and choose that",
    "SEQUENCE": "is an image sequence: open one of its files as a single image",
    "TILED": "has several tiles (UDIM): open one of its tiles as a single image",
}


@dataclass(frozen=True, eq=False)
class ImageSource:
    """How an image leaves Blender.

    Attributes
    ----------
    name : str
        Full name of the datablock, with its library.
    path : Path or None
        File with exactly the content that Blender shows.
    data : bytes or None
        Packed bytes of such a file.
    transfer : str
        "srgb" or "linear": coding of the file or of the pixels; "auto" for a file that may have a
        colour profile.
    size : tuple of int
        Width and height of the pixels; (0, 0) for a file.
    channels : int
        Number of channels of the pixels.
    is_float : bool
        Whether the pixels are linear values rather than codes.
    associated : bool
        Whether colours are multiplied by alpha.
    uses_alpha : bool
        Whether alpha marks the object.
    to_rec709 : (3, 3) ndarray or None
        From Blender's working space to linear Rec.709.
    """

    name: str
    path: Path | None = None
    data: bytes | None = None
    transfer: str = "srgb"
    size: tuple[int, int] = (0, 0)
    channels: int = 4
    is_float: bool = False
    associated: bool = False
    uses_alpha: bool = True
    to_rec709: np.ndarray | None = None


def inspect_image(image: Any, *, as_pixels: bool = False) -> ImageSource:
    """Determine how an image can be handed over.

    Parameters
    ----------
    image : bpy.types.Image
        The image.
    as_pixels : bool, optional
        Whether pixels are needed even where the image equals its file.

    Returns
    -------
    ImageSource
        The file or the layout of the pixels.

    Raises
    ------
    InputError
        If the image is no single still image, has no data, or has an unsupported size or colour
        space.
    """
    if image.source in _UNSUPPORTED_SOURCES:
        raise InputError(f"the image {image.name} {_UNSUPPORTED_SOURCES[image.source]}")
    if image.type == "RENDER_RESULT":
        raise InputError(
            "the render result cannot be read: save it (Image > Save As) and open the file"
        )
    if not as_pixels and (unchanged := _unchanged_file(image)) is not None:
        return unchanged
    size = (int(image.size[0]), int(image.size[1]))
    if 0 in size or len(image.pixels) != size[0] * size[1] * image.channels:
        raise InputError(_no_data_message(image))
    if min(size) < MIN_SIDE:
        raise InputError(
            f"the image {image.name} is {size[0]} x {size[1]} pixels: choose a larger one"
        )
    if size[0] * size[1] > MAX_PIXELS:
        raise InputError(
            f"the image {image.name} has {size[0] * size[1] / 1e6:.0f} million pixels: "
            "scale it down (Image > Resize)"
        )
    transfer = "linear" if image.is_float else _transfer(image)
    if not transfer:
        raise InputError(
            f"the image {image.name} has the color space {image.colorspace_settings.name}: "
            "choose sRGB, Linear Rec.709 or Non-Color for it"
        )
    uses_alpha = image.alpha_mode in {"STRAIGHT", "PREMUL"}
    return ImageSource(
        name=image.name_full,
        transfer=transfer,
        size=size,
        channels=int(image.channels),
        is_float=bool(image.is_float),
        associated=image.is_float and uses_alpha,
        uses_alpha=uses_alpha,
        to_rec709=working_to_rec709(),
    )


def suffix_of(head: bytes) -> str:
    """Return the suffix of an image file from its first bytes.

    Parameters
    ----------
    head : bytes
        First bytes of the file; four suffice.

    Returns
    -------
    str
        For example ".png"; "" for an unknown format.
    """
    return next((suffix for magic, suffix in _SUFFIXES.items() if head[:4].startswith(magic)), "")


def exif_orientation(head: bytes) -> int:
    """Read the orientation flag of a JPEG, PNG or TIFF file.

    Parameters
    ----------
    head : bytes
        First bytes of the file.

    Returns
    -------
    int
        1 (upright, or no flag) to 8; 0 if the flag lies beyond `head`.
    """
    markers = ((b"Exif\0\0", 6), (b"eXIf", 4))
    found = (
        at + skip for marker, skip in markers if (at := head.find(marker, 0, _HEAD_BYTES)) >= 0
    )
    start = 0 if suffix_of(head) == ".tif" else next(found, -1)
    if start < 0:
        return 1
    order = "<" if head[start : start + 2] == b"II" else ">"
    try:
        (first,) = struct.unpack_from(f"{order}I", head, start + 4)
        (count,) = struct.unpack_from(f"{order}H", head, start + first)
        for entry in range(count):
            tag, _, _, value = struct.unpack_from(
                f"{order}HHIH", head, start + first + 2 + 12 * entry
            )
            if tag == _ORIENTATION_TAG:
                return int(value)
    except struct.error:
        # A TIFF may keep its table behind the pixels; an unknown flag counts as not upright.
        return 0
    return 1


def working_to_rec709() -> np.ndarray:
    """Return the matrix from Blender's scene-linear working space to linear Rec.709.

    Returns
    -------
    (3, 3) ndarray of float32
        Up to rounding the identity where the working space is linear Rec.709, Blender's default.
    """
    axes = [mathutils.Color(axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    return np.array(
        [tuple(axis.from_scene_linear_to_rec709_linear()) for axis in axes], np.float32
    ).T


def _unchanged_file(image: Any) -> ImageSource | None:
    """The image as its file, packed or on disk, if the worker would read what Blender shows."""
    transfer = _transfer(image)
    if image.source != "FILE" or image.is_dirty or not transfer:
        return None
    if image.packed_file is not None:
        data = bytes(image.packed_file.data)
        if not _reads_alike(data, image.alpha_mode):
            return None
        return ImageSource(image.name_full, data=data, transfer=_of_file(transfer, data))
    path = Path(image.filepath_from_user())
    if not path.is_file():  # opening a pipe would wait for its writer
        return None
    try:
        with (
            path.open("rb") as file,
            mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
        ):
            fits = _reads_alike(content[:_HEAD_BYTES], image.alpha_mode)
            transfer = _of_file(transfer, content[:_HEAD_BYTES])
    except (OSError, ValueError):
        # A missing, unreadable or empty file: the pixels that Blender still has are used.
        return None
    return ImageSource(image.name_full, path=path, transfer=transfer) if fits else None


def _transfer(image: Any) -> str:
    """Coding of an image's file: "srgb", "linear", or "" if the worker does not support it."""
    space = image.colorspace_settings
    if space.name == "sRGB":
        return "srgb"
    return "linear" if space.is_data or space.name in _LINEAR_SPACES else ""


def _of_file(transfer: str, head: bytes) -> str:
    """The same for the file itself: a profile in it may name another curve than sRGB's."""
    return "auto" if transfer == "srgb" and suffix_of(head) in _WITH_PROFILE else transfer


def _reads_alike(head: bytes, alpha_mode: str) -> bool:
    """Whether the worker reads the format with the same alpha and orientation as Blender."""
    suffix = suffix_of(head)
    default_mode = "PREMUL" if suffix == ".exr" else "STRAIGHT"
    return suffix != "" and alpha_mode == default_mode and exif_orientation(head) == 1


def _no_data_message(image: Any) -> str:
    if image.source == "FILE" and not image.packed_file:
        path = Path(image.filepath_from_user())
        if path.suffix.lower() in UNUSUAL_SUFFIXES and path.is_file():
            return (
                f"the image {image.name} is a {path.suffix[1:].upper()} file, which Blender cannot "
                "show: save it as a PNG, or decompose it with isc and import the result"
            )
        return (
            f"the image {image.name} has no data: its file {image.filepath_from_user()} is missing "
            "or damaged; open it again"
        )
    return f"the image {image.name} has no data: open a file or choose another image"
