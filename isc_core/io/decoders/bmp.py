"""Windows bitmaps."""

import io
from pathlib import Path

from PIL import BmpImagePlugin

from ..limits import Limits
from .pillow import decode_pillow
from .raster import Raster


def read_bmp(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a Windows bitmap.

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
    """
    return decode_pillow(BmpImagePlugin.BmpImageFile(io.BytesIO(data)), path, limits)
