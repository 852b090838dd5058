"""JPEG files."""

import io
from pathlib import Path

from PIL import JpegImagePlugin

from ..limits import Limits
from .pillow import decode_pillow
from .raster import Raster


def read_jpeg(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a JPEG."""
    return decode_pillow(JpegImagePlugin.JpegImageFile(io.BytesIO(data)), path, limits)
