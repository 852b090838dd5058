"""The focal length of a photo from its EXIF metadata.

Problem: a perspective camera needs the focal length in pixels, which cannot be computed from
millimetres without the size of the sensor.

Equation: from FocalLengthIn35mmFilm F, which refers to the diagonal of a frame of 36 x 24 mm, f = F
/ 43.27 d, d the photo's diagonal in pixels; else from FocalLength and FocalPlaneXResolution r, f =
FocalLength r, times the photo's long side over that of PixelXDimension and PixelYDimension. Nothing
else is used: databases of sensors become outdated.

Citation: CIPA DC-008-2023, Exchangeable image file format for digital still cameras: Exif version
3.0, section 4.6.

Limits: a photo of another aspect ratio than in the metadata was cropped, so the focal length is
invalid. A crop of the same aspect ratio, or after which a program updated the metadata, is not
detected.
"""

import math
import struct
from dataclasses import replace
from typing import Any

from PIL import Image

from ..focal_length import LONGEST_35MM, SHORTEST_35MM, FocalLength, pixels_of_35mm
from .raster import Raster

_EXIF_IFD = 0x8769
_FOCAL_LENGTH, _IN_35MM = 0x920A, 0xA405
_PIXEL_X, _PIXEL_Y = 0xA002, 0xA003
_PLANE_X, _PLANE_UNIT = 0xA20E, 0xA210
_MILLIMETRES = {2: 25.4, 3: 10.0, 4: 1.0, 5: 1e-3}  # of FocalPlaneResolutionUnit
_SAME_PROPORTION = 0.02
_UNREADABLE = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    KeyError,
    ArithmeticError,
    struct.error,
)


def with_focal_length(raster: Raster, metadata: Image.Image | Image.Exif | bytes) -> Raster:
    """Add the focal length from the metadata of a file, if it can be read.

    Parameters
    ----------
    raster : Raster
        The whole photo.
    metadata : Image, Exif or bytes
        The opened image, its EXIF, or the bytes of an EXIF block or a whole TIFF.

    Returns
    -------
    Raster
    """
    try:
        exif = metadata.getexif() if isinstance(metadata, Image.Image) else metadata
        if isinstance(exif, bytes):
            data, exif = exif, Image.Exif()
            exif.load(data)
        found = _focal_length(exif.get_ifd(_EXIF_IFD), raster.values.shape)
    except _UNREADABLE:
        return raster
    return replace(raster, focal_length=found)


def _focal_length(tags: dict[int, Any], shape: tuple[int, ...]) -> FocalLength | None:
    size, given = (shape[1], shape[0]), (_number(tags, _PIXEL_X), _number(tags, _PIXEL_Y))
    pixels = pixels_of_35mm(_number(tags, _IN_35MM), size)
    if not pixels:
        unit = _MILLIMETRES.get(int(tags.get(_PLANE_UNIT, 2)), 0.0)
        density = _number(tags, _PLANE_X) / unit if unit else 0.0
        resized = max(size) / max(given) if all(given) else 1.0
        pixels = _number(tags, _FOCAL_LENGTH) * density * resized
    shortest, longest = (pixels_of_35mm(one, size) for one in (SHORTEST_35MM, LONGEST_35MM))
    if not shortest <= pixels <= longest:
        return None
    return FocalLength(pixels, all(given) and not _same_proportion(size, given))


def _number(tags: dict[int, Any], tag: int) -> float:
    """A positive number; 0 without one."""
    value = float(tags.get(tag, 0))
    return value if math.isfinite(value) and value > 0 else 0.0


def _same_proportion(size: tuple[int, int], given: tuple[float, float]) -> bool:
    """Whether two frames have the same aspect ratio, up to rotation by 90 degrees."""
    ratio = max(size) / min(size) * min(given) / max(given)
    return abs(math.log(ratio)) < _SAME_PROPORTION
