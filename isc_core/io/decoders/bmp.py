"""Windows bitmaps."""

import io
from pathlib import Path

from PIL import BmpImagePlugin

from ..limits import Limits
from .pillow import decode_pillow
from .raster import Raster


def read_bmp(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a Windows bitmap."""
    return decode_pillow(BmpImagePlugin.BmpImageFile(io.BytesIO(data)), path, limits)
