"""Radiance HDR files."""

import re
from pathlib import Path

from ..limits import Limits
from .opencv import decode_opencv
from .raster import Raster, check_size, raster_of_codes


def read_hdr(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a Radiance HDR."""
    size = re.search(rb"\n-Y (\d+) \+X (\d+)\n", data)
    if size is None:
        raise ValueError("no upright resolution line")
    check_size(path, limits, int(size[2]), int(size[1]))
    return raster_of_codes(decode_opencv(data), 0)
