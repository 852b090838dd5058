"""TIFF and BigTIFF files of 8 and 16 bits and floats; only the first page."""

import io
from pathlib import Path

import numpy as np
from PIL import TiffImagePlugin

from ...errors import InputError
from ..limits import Limits
from .colour.icc import space_of_profile
from .exif import with_focal_length
from .pillow import decode_pillow
from .raster import Raster, check_size, raster_of_codes
from .tiff_samples import sample_type, tiff_samples

# Number and default of BitsPerSample, SamplesPerPixel, PhotometricInterpretation, ExtraSamples and
# Orientation.
_TIFF_TAGS = ((258, 1), (277, 1), (262, -1), (338, -1), (274, 1))
_PROFILE = 34675
_PREMULTIPLIED, _UNSPECIFIED = 1, 0  # extra samples
_GREY_OR_RGB = {1: (1,), 2: (3, 4)}  # samples by PhotometricInterpretation


def read_tiff(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a TIFF.

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
        If the size, the colours, the number of channels or the bit depth is not supported.
    """
    stream = io.BytesIO(data)
    tags = TiffImagePlugin.ImageFileDirectory_v2(
        stream.read(16 if data[2:3] == b"+" or data[3:4] == b"+" else 8)
    )
    stream.seek(tags.next)
    tags.load(stream)
    check_size(path, limits, int(tags[256]), int(tags[257]))
    bits, samples, photometric, extra, orientation = (
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
    if sample_type(tags) is None or samples not in _GREY_OR_RGB.get(photometric, ()):
        raise InputError(
            f"{path}: a TIFF with {samples} channels of {bits} bits of this kind is not "
            "supported: save it as a 16-bit RGB PNG"
        )
    pixels = tiff_samples(data, tags)
    pixels = pixels.astype(np.float32 if pixels.dtype.kind == "f" else np.uint16, copy=False)
    if samples == 4 and extra == _UNSPECIFIED:
        pixels = pixels[..., :3]
    space, notes = (
        space_of_profile(bytes(tags[_PROFILE]), 1 if samples == 1 else 3)
        if _PROFILE in tags
        else (None, ())
    )
    raster = raster_of_codes(pixels, 65535, orientation, extra == _PREMULTIPLIED, space, notes)
    return with_focal_length(raster, data)
