"""Portable pixmaps and graymaps (PPM, PGM), of 8 and 16 bits."""

import io
import re
from pathlib import Path

import numpy as np
from PIL import PpmImagePlugin

from ..limits import Limits
from .pillow import decode_pillow
from .raster import Raster, check_size, raster_of_codes

# Magic number, width, height and, except for bitmaps, the largest code. Possessive quantifiers
# prevent backtracking over whitespace.
_GAP = rb"(?:\s|#[^\n]*+\n)++"
_BITMAP = re.compile(rb"P[14]" + _GAP + rb"(\d+)" + _GAP + rb"(\d+)\s")
_MAP = re.compile(rb"P([2356])" + _GAP + rb"(\d+)" + _GAP + rb"(\d+)" + _GAP + rb"(\d+)\s")
_HEADER_BYTES = 1 << 14


def read_pnm(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a PPM or PGM.

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
        If the size or the colour mode is not supported.
    ValueError
        If there is no header within 16 KiB, codes exceed the stated maximum, or the maximum exceeds
        65535.
    """
    header = _MAP.match(data[:_HEADER_BYTES])
    if header is None and not _BITMAP.match(data[:_HEADER_BYTES]):
        raise ValueError("no header")
    if header is None or header[1] in b"23" or int(header[4]) < 256:
        return decode_pillow(PpmImagePlugin.PpmImageFile(io.BytesIO(data)), path, limits)
    width, height, peak = int(header[2]), int(header[3]), int(header[4])
    check_size(path, limits, width, height)
    channels = 3 if header[1] == b"6" else 1
    codes = np.frombuffer(data, ">u2", width * height * channels, header.end()).astype(np.uint16)
    if peak > 65535 or codes.max() > peak:
        raise ValueError("codes above the stated maximum")
    return raster_of_codes(codes.reshape(height, width, channels), peak)
