"""HEIC and HEIF files, decoded by libheif through the optional package pillow-heif.

libheif applies the rotation in the file. An EXIF orientation is redundant and ignored.

Limits: only the primary picture; no depth maps, bursts or gain maps.
"""

import io
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ...errors import InputError
from ...extras import install_command
from ..limits import Limits
from ..reading_notes import ReadingNote
from .colour.cicp import space_of_code_points
from .colour.icc import space_of_profile
from .colour.space import ColourSpace
from .exif import with_focal_length
from .gain_map import gain_map_notes
from .raster import Raster, check_size, raster_of_codes


def read_heif(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a HEIC.

    Codes of more than 8 bits are scaled to 16.

    Parameters
    ----------
    data : bytes
        The whole file.
    path : Path
        Prefix of the error message.
    limits : Limits

    Returns
    -------
    Raster

    Raises
    ------
    InputError
        If pillow-heif is missing, or the size or the colours are not supported.
    """
    image = _library(path).open_heif(io.BytesIO(data), convert_hdr_to_8bit=False)
    check_size(path, limits, *image.size)
    bits = int(image.info.get("bit_depth", 8))
    codes = np.asarray(image)
    if codes.dtype == np.uint16:  # the code is in the upper bits
        spread = np.rint(np.arange(2**bits) * (65535 / (2**bits - 1))).astype(np.uint16)
        codes = spread[codes >> (16 - bits)]
    space, notes = _colours(image.info, 1 if codes.ndim == 2 else 3, path)
    raster = raster_of_codes(
        codes,
        int(np.iinfo(codes.dtype).max),
        premultiplied="a" in image.mode,
        space=space,
        notes=(*notes, *gain_map_notes(data)),
    )
    raster = replace(raster, bit_depth=bits)
    return with_focal_length(raster, image.info["exif"]) if image.info.get("exif") else raster


def _library(path: Path) -> ModuleType:
    try:
        import pillow_heif
    except ImportError as error:
        raise InputError(
            f"{path}: HEIC needs pillow-heif: install it with `{install_command('heic')}`, or "
            "save the photo as a JPEG"
        ) from error
    return pillow_heif


def _colours(
    info: dict[str, Any], channels: int, path: Path
) -> tuple[ColourSpace | None, tuple[ReadingNote, ...]]:
    if "icc_profile" in info:
        return space_of_profile(info["icc_profile"], channels)
    points = info.get("nclx_profile", {})
    primaries, transfer = (
        int(points.get(name, 2)) for name in ("color_primaries", "transfer_characteristics")
    )
    return space_of_code_points(primaries, transfer, path), ()
