"""JPEG files."""

import io
import re
from pathlib import Path

from PIL import JpegImagePlugin

from ...errors import InputError
from ..limits import Limits
from .colour.dcf import space_of_exif
from .gain_map import gain_map_notes
from .pillow import decode_pillow
from .raster import Raster

# A decoder visits every pixel in each scan and cannot be interrupted. Encoders write at most 14.
_MAX_SCANS = 100
_MAX_SEGMENTS = 10_000
_START_OF_SCAN, _END_OF_IMAGE = 0xDA, 0xD9
# Compressed data contain 0xFF only before 0 and within restart markers.
_MARKER = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")


def read_jpeg(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a JPEG.

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
        If the size, the colour mode or the number of scans is not supported.
    ValueError
        If the file has far more segments than a picture needs.
    """
    check_scans(data, path)
    image = JpegImagePlugin.JpegImageFile(io.BytesIO(data))
    space, notes = space_of_exif(image), gain_map_notes(data)
    return decode_pillow(image, path, limits, space=space, notes=notes)


def check_scans(data: bytes, path: Path | str) -> None:
    """Raise `InputError` for a JPEG of more scans than encoders write.

    Segments are skipped by their length, since metadata may contain another JPEG.

    Parameters
    ----------
    data : bytes
        The whole file.
    path : Path or str
        Prefix of the error message.

    Raises
    ------
    InputError
        If there are more than 100 scans.
    ValueError
        If the file has far more segments than a picture needs.
    """
    scans, at = 0, 2
    for _ in range(_MAX_SEGMENTS):
        marker = _MARKER.search(data, at)
        if marker is None or data[marker.start() + 1] == _END_OF_IMAGE:
            return
        scans += data[marker.start() + 1] == _START_OF_SCAN
        if scans > _MAX_SCANS:
            raise InputError(
                f"{path}: a JPEG of more than {_MAX_SCANS} scans: save it again as a plain JPEG "
                "or PNG"
            )
        at = marker.end() + int.from_bytes(data[marker.end() : marker.end() + 2], "big")
    raise ValueError("too many segments")
