"""Images of 8 bits per channel, decoded by Pillow, and the EXIF orientation."""

import struct
from pathlib import Path

import numpy as np
from PIL import Image

from ...errors import InputError
from ..limits import Limits
from ..reading_notes import ReadingNote
from .colour.icc import space_of_profile
from .colour.space import ColourSpace
from .exif import with_focal_length
from .raster import Raster, check_size, raster_of_codes

_ORIENTATION_TAG = 0x0112


def exif_orientation(image: Image.Image) -> int:
    """Return the EXIF orientation of an image.

    Parameters
    ----------
    image : PIL.Image.Image

    Returns
    -------
    int
        As stored; 1 if unknown.
    """
    try:
        return int(image.getexif().get(_ORIENTATION_TAG, 1))
    except (OSError, SyntaxError, ValueError, TypeError, KeyError, struct.error):
        return 1  # unreadable metadata has no orientation; the pixels are still valid


def decode_pillow(
    image: Image.Image,
    path: Path,
    limits: Limits,
    oriented: bool = False,
    space: ColourSpace | None = None,
    notes: tuple[ReadingNote, ...] = (),
) -> Raster:
    """Decode an image of 8 bits per channel. A truncated file raises OSError.

    Parameters
    ----------
    image : PIL.Image.Image
    path : Path
        Prefix of the error message.
    limits : Limits
    oriented : bool
        Whether the decoder has already applied the orientation.
    space : ColourSpace, optional
        Replaced by an ICC profile that Pillow finds in the file.
    notes : tuple of ReadingNote

    Returns
    -------
    Raster

    Raises
    ------
    InputError
        If the size or the colour mode is not supported.
    """
    check_size(path, limits, *image.size)
    if image.mode in ("CMYK", "LAB", "HSV"):
        raise InputError(
            f"{path}: {image.mode} colours are not supported: convert it to "
            "RGB, for example as a PNG"
        )
    orientation = 1 if oriented else exif_orientation(image)
    image.load()
    has_alpha = image.mode in ("LA", "La", "PA", "RGBA", "RGBa") or "transparency" in image.info
    mode = "RGBA" if has_alpha else "L" if image.mode in ("1", "L") else "RGB"
    if image.mode == "RGBa" or image.mode in (
        "1",
        "L",
        "LA",
        "PA",
        "P",
        "RGB",
        "RGBA",
        "RGBX",
        "YCbCr",
    ):
        if "icc_profile" in image.info:
            space, more = space_of_profile(image.info["icc_profile"], 1 if mode == "L" else 3)
            notes = (*notes, *more)
        codes = np.asarray(image if image.mode == mode else image.convert(mode))
        raster = raster_of_codes(codes, 255, orientation, space=space, notes=notes)
        return with_focal_length(raster, image)
    raise InputError(
        f"{path}: pixels of kind {image.mode} are not supported: convert it to an 8- or 16-bit "
        "PNG or an EXR"
    )
