"""TIFF and BigTIFF files, of 8 and 16 bits and floats; the first of several pages."""

import io
from pathlib import Path

import numpy as np
from PIL import TiffImagePlugin

from ...errors import InputError
from ..limits import Limits
from .colour.icc import space_of_profile
from .opencv import decode_opencv
from .pillow import decode_pillow
from .raster import Raster, check_size, raster_of_codes

# Number and default of BitsPerSample, SamplesPerPixel, PhotometricInterpretation, SampleFormat,
# ExtraSamples.
_TIFF_TAGS = ((258, 1), (277, 1), (262, -1), (339, 1), (338, 0))
_PROFILE = 34675


def read_tiff(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a TIFF: 8 bits by Pillow, others by OpenCV, which apply the orientation.

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
        If the size, the colours, the number of channels or the bit depth is not supported.
    """
    stream = io.BytesIO(data)
    tags = TiffImagePlugin.ImageFileDirectory_v2(
        stream.read(16 if data[2:3] == b"+" or data[3:4] == b"+" else 8)
    )
    stream.seek(tags.next)
    tags.load(stream)
    check_size(path, limits, int(tags[256]), int(tags[257]))
    bits, samples, photometric, stores, extra = (
        int(np.ravel(tags.get(tag, n))[0]) for tag, n in _TIFF_TAGS
    )
    if photometric == 5:
        raise InputError(
            f"{path}: CMYK colours are not supported: convert it to RGB, for example as a PNG"
        )
    if bits <= 8:
        return decode_pillow(
            TiffImagePlugin.TiffImageFile(io.BytesIO(data)), path, limits, oriented=True
        )
    pixels = decode_opencv(data)
    fits = (pixels.dtype == np.uint16 and stores == 1 and bits == 16) or pixels.dtype.kind == "f"
    if (
        not fits
        or photometric not in (1, 2, 32844, 32845)
        or samples != (pixels.shape[2] if pixels.ndim == 3 else 1)
    ):
        raise InputError(
            f"{path}: a TIFF with {samples} channels of {bits} bits of this kind is not "
            "supported: save it as a 16-bit RGB PNG"
        )
    if pixels.dtype.kind == "f":
        pixels = pixels.astype(np.float32)
    space, notes = (
        space_of_profile(bytes(tags[_PROFILE]), 1 if pixels.ndim == 2 else 3)
        if _PROFILE in tags
        else (None, ())
    )
    return raster_of_codes(pixels, 65535, premultiplied=extra == 1, space=space, notes=notes)
