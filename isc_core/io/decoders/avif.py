"""AVIF files, decoded by libavif in Pillow.

Limits: 8 bits per channel; Pillow reduces files of more bits.
"""

import io
from pathlib import Path

from ...errors import InputError
from ..limits import Limits
from .colour.cicp import space_of_code_points
from .gain_map import gain_map_notes
from .pillow import decode_pillow
from .raster import Raster

_HEADER_BYTES = 1 << 16
_CODE_POINTS = b"colrnclx"


def read_avif(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode an AVIF.

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
        If Pillow is built without AVIF, or the size or the colours are not supported.
    """
    try:
        from PIL import AvifImagePlugin

        supported = AvifImagePlugin.SUPPORTED
    except ImportError:
        supported = False
    if not supported:
        raise InputError(
            f"{path}: AVIF needs Pillow 11.3 or later: install it with "
            "`pip install 'pillow>=11.3'`, or save the photo as a JPEG"
        )
    image = AvifImagePlugin.AvifImageFile(io.BytesIO(data))
    notes = gain_map_notes(data)
    at = data.find(_CODE_POINTS, 0, _HEADER_BYTES) + len(_CODE_POINTS)
    if image.info.get("icc_profile") or at < len(_CODE_POINTS):
        return decode_pillow(image, path, limits, notes=notes)
    primaries, transfer = (int.from_bytes(data[at + k : at + k + 2], "big") for k in (0, 2))
    space = space_of_code_points(primaries, transfer, path)
    return decode_pillow(image, path, limits, space=space, notes=notes)
