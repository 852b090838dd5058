"""PNG files of 8 and 16 bits per channel, and writing them."""

import errno
import io
import struct
import zlib
from pathlib import Path

import numpy as np
from PIL import PngImagePlugin

from ..limits import Limits
from .colour.png_chunks import COLOUR_CHUNKS, profile_chunk, space_of_chunks
from .opencv import decode_opencv
from .pillow import decode_pillow, exif_orientation
from .raster import Raster, as_rgb, check_size, raster_of_codes

# Writers split the pixels into chunks of 4 KiB or more.
_CHUNKS, _CHUNK_BYTES = 1000, 512
_HEADER = 33  # bytes of the signature and of IHDR, behind which a profile stands
_GREY = (0, 4)  # colour types


def read_png(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a PNG.

    16 bits go through OpenCV, because Pillow reduces RGB to 8. The checksum of each chunk is
    verified first, which decoders skip.

    Parameters
    ----------
    data : bytes
        The whole file.
    path : Path
        Named in errors.
    limits : Limits

    Returns
    -------
    Raster

    Raises
    ------
    InputError
        If the image is larger than the limits, or the file is damaged.
    """
    width, height, bits, kind = struct.unpack(">IIBB", data[16:26])
    check_size(path, limits, width, height)
    plain, chunks = _plain_png(data)
    image = PngImagePlugin.PngImageFile(io.BytesIO(plain))
    space, notes = space_of_chunks(chunks, 1 if kind in _GREY else 3, path)
    if bits == 16:
        codes, orientation = decode_opencv(plain), exif_orientation(image)
        return raster_of_codes(codes, 65535, orientation, space=space, notes=notes)
    return decode_pillow(image, path, limits, space=space, notes=notes)


def _plain_png(data: bytes) -> tuple[bytes, dict[bytes, bytes]]:
    """The PNG reduced to pixels, transparency and EXIF, and what its colour chunks hold.

    Raises ValueError for a wrong checksum, a missing end, or far more chunks than pixels take.
    """
    kept, colours, at = [data[:8]], {}, 8
    for _ in range(_CHUNKS + len(data) // _CHUNK_BYTES):
        (length,) = struct.unpack(">I", data[at : at + 4])
        chunk = data[at : at + 12 + length]
        kind = chunk[4:8]
        if (
            len(chunk) < 12 + length
            or zlib.crc32(chunk[4:-4]) != struct.unpack(">I", chunk[-4:])[0]
        ):
            raise ValueError("a PNG chunk is damaged")
        if kind in (b"IHDR", b"PLTE", b"tRNS", b"eXIf", b"IDAT", b"IEND"):
            kept.append(chunk)
        if kind in COLOUR_CHUNKS:
            colours[kind] = chunk[8:-4]
        if kind == b"IEND":
            return b"".join(kept), colours
        at += 12 + length
    raise ValueError("too many PNG chunks")


def write_png(path: Path, raster: Raster) -> None:
    """Write integer codes and their alpha as a PNG of 8 or 16 bits, unchanged, with their profile.

    Parameters
    ----------
    path : Path
    raster : Raster
        Of integer codes.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    assert raster.peak is not None, "floats have no codes"
    kind = raster.values.dtype
    planes = (
        as_rgb(raster.values)[..., ::-1]
        if raster.alpha is not None or raster.values.shape[2] == 3
        else raster.values
    )
    if raster.alpha is not None:
        planes = np.concatenate(
            [planes, np.rint(raster.alpha * float(np.iinfo(kind).max)).astype(kind)[..., None]],
            axis=2,
        )
    import cv2  # takes a tenth of a second, and is not needed to read

    done, data = cv2.imencode(".png", np.ascontiguousarray(planes))
    if not done:
        raise OSError(errno.EIO, "the PNG could not be encoded")
    written = data.tobytes()
    if raster.space is not None and raster.space.profile:
        chunk = b"iCCP" + profile_chunk(raster.space.profile)
        framed = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
        written = written[:_HEADER] + framed + written[_HEADER:]
    path.write_bytes(written)
