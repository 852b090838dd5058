"""PNG files of 8 and 16 bits per channel, and writing them."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
from PIL import PngImagePlugin

from ..limits import Limits
from ..png import encode_png, png_chunk
from .colour.png_chunks import COLOUR_CHUNKS, profile_chunk, space_of_chunks
from .exif import with_focal_length
from .pillow import decode_pillow, exif_orientation
from .png_halves import deep_codes
from .raster import Raster, as_rgb, check_size, raster_of_codes

# Writers split the pixels into chunks of 4 KiB or more.
_CHUNKS, _CHUNK_BYTES = 1000, 512
_HEADER = 33  # bytes of the signature and of IHDR, after which a profile is inserted
_GREY = (0, 4)  # colour types
_ABOUT = (b"IHDR", b"eXIf", b"IEND")
_KEPT = (*_ABOUT, b"PLTE", b"tRNS", b"IDAT")


def read_png(data: bytes, path: Path, limits: Limits) -> Raster:
    """Decode a PNG.

    The checksum of each chunk is verified first, since decoders skip it.

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
    deep = bits == 16  # Pillow opens it only for its EXIF and does not decode the pixels
    plain, chunks = _plain_png(data, _ABOUT if deep else _KEPT)
    image = PngImagePlugin.PngImageFile(io.BytesIO(plain))
    space, notes = space_of_chunks(chunks, 1 if kind in _GREY else 3, path)
    if deep:
        codes = _with_alpha(deep_codes(data[16:29], chunks[b"IDAT"]), chunks.get(b"tRNS", b""))
        raster = raster_of_codes(codes, 65535, exif_orientation(image), space=space, notes=notes)
        return with_focal_length(raster, image)
    return decode_pillow(image, path, limits, space=space, notes=notes)


def _plain_png(data: bytes, kinds: tuple[bytes, ...]) -> tuple[bytes, dict[bytes, bytes]]:
    """The PNG reduced to some kinds of chunks, and the content of its chunks, with those of pixels
    joined.

    Raises ValueError for a wrong checksum, a missing end, or far more chunks than pixels need.
    """
    whole, at = memoryview(data), 8
    kept, pixels, held = [whole[:at]], list[memoryview](), dict[bytes, bytes]()
    for _ in range(_CHUNKS + len(data) // _CHUNK_BYTES):
        (length,) = struct.unpack(">I", whole[at : at + 4])
        chunk = whole[at : at + 12 + length]
        kind = bytes(chunk[4:8])
        if (
            len(chunk) < 12 + length
            or zlib.crc32(chunk[4:-4]) != struct.unpack(">I", chunk[-4:])[0]
        ):
            raise ValueError("a PNG chunk is damaged")
        if kind in kinds:
            kept.append(chunk)
        if kind == b"IDAT":
            pixels.append(chunk[8:-4])
        elif kind in _KEPT or kind in COLOUR_CHUNKS:
            held[kind] = bytes(chunk[8:-4])
        if kind == b"IEND":
            return b"".join(kept), held | {b"IDAT": b"".join(pixels)}
        at += 12 + length
    raise ValueError("too many PNG chunks")


def _with_alpha(codes: np.ndarray, transparent: bytes) -> np.ndarray:
    """Codes of 16 bits, with grey and alpha expanded to RGBA and a transparent colour to alpha."""
    planes = codes if codes.ndim == 3 else codes[..., None]
    channels = planes.shape[2]
    if channels == 2:
        return planes[..., [0, 0, 0, 1]]
    if channels == 4 or len(transparent) != 2 * channels:
        return codes
    alpha = np.where((planes == np.frombuffer(transparent, ">u2")).all(axis=2), 0, 65535)
    return np.dstack([as_rgb(planes), alpha.astype(np.uint16)])


def write_png(path: Path, raster: Raster) -> None:
    """Write integer codes and their alpha as a PNG of 8 or 16 bits, with their profile.

    Parameters
    ----------
    path : Path
    raster : Raster
        Of integer codes. They are written unchanged, or, where their peak is not the largest code
        of a PNG, scaled to it.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    assert raster.peak is not None, "floats have no codes"
    kind, planes = raster.values.dtype, raster.values
    largest = int(np.iinfo(kind).max)
    if raster.peak != largest:
        scaled = np.rint(np.arange(raster.peak + 1) * (largest / raster.peak))
        planes = scaled.astype(kind)[planes]
    if raster.alpha is not None:
        alpha = np.rint(raster.alpha * float(largest)).astype(kind)
        planes = np.dstack([as_rgb(planes), alpha])
    written = encode_png(planes, compression=1)
    if raster.space is not None and raster.space.profile:
        chunk = png_chunk(b"iCCP", profile_chunk(raster.space.profile))
        written = written[:_HEADER] + chunk + written[_HEADER:]
    path.write_bytes(written)
