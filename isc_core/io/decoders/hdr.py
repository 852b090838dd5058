"""Radiance HDR files."""

import re
from pathlib import Path

from ..limits import Limits
from .opencv import decode_opencv
from .raster import Raster, check_size, raster_of_codes

_HEADER_BYTES = 1 << 14


def read_hdr(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a Radiance HDR.

    Parameters
    ----------
    data : bytes
        The whole file.
    path : Path
        Opens the error message.
    limits : Limits

    Returns
    -------
    Raster

    Raises
    ------
    InputError
        If the size is not supported.
    ValueError
        If 16 KiB hold no upright resolution line, or OpenCV cannot decode the file.
    """
    size = re.search(rb"\n-Y (\d+) \+X (\d+)\n", data[:_HEADER_BYTES])
    if size is None:
        raise ValueError("no upright resolution line")
    check_size(path, limits, int(size[2]), int(size[1]))
    return raster_of_codes(decode_opencv(data), 0)
