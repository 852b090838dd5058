"""Decoders of image files: one format per module, detected from the content, not the name.

Only the module of a file's format is imported, with the part of Pillow that it needs.
"""

import hashlib
import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import cast

import numpy as np
from PIL import Image

from ...errors import InputError
from ..limits import DEFAULT_LIMITS, Limits
from ..memory import READING_BYTES_PER_PIXEL, is_available, is_exhausted, memory_error
from ..native_io import suppress_native_output
from ..regular_files import read_regular
from .raster import MIN_SIDE, Raster
from .raw import is_raw

_DECODING_ERRORS = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    IndexError,
    KeyError,
    RuntimeError,
    EOFError,
    OverflowError,
    struct.error,
    zlib.error,
    Image.DecompressionBombError,
)

_Reader = Callable[[bytes, Path, Limits], Raster]
# How files begin, their format, and its module: `read_png` in `png` reads a PNG.
_FORMATS: tuple[tuple[bytes, str, str], ...] = (
    (b"\x89PNG\r\n\x1a\n", "PNG", "png"),
    (b"\xff\xd8\xff", "JPEG", "jpeg"),
    (b"II*\0", "TIFF", "tiff"),
    (b"MM\0*", "TIFF", "tiff"),
    (b"II+\0", "TIFF", "tiff"),
    (b"MM\0+", "TIFF", "tiff"),
    (b"\x76\x2f\x31\x01", "EXR", "exr"),
    (b"#?RADIANCE", "HDR", "hdr"),
    (b"#?RGBE", "HDR", "hdr"),
    (b"BM", "BMP", "bmp"),
    (b"\x93NUMPY", "NPY", "npy"),
    *((b"P%d" % n, "PPM", "pnm") for n in range(1, 7)),
)


# HEIF files begin with a box `ftyp` that lists compatible formats.
_AVIF_BRANDS = {b"avif", b"avis"}
_HEIF_BRANDS = {b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"mif2", b"msf1"}


@dataclass(frozen=True)
class _RecordingLimits(Limits):
    """Limits that record the sizes that were checked."""

    sizes: list[tuple[int, int]] = field(default_factory=list)

    def check_pixels(self, path: Path | str, width: int, height: int) -> None:
        super().check_pixels(path, width, height)
        self.sizes.append((width, height))


def read_raster(path: str | Path, limits: Limits = DEFAULT_LIMITS) -> Raster:
    """Read the stored values of an image file, in upright orientation.

    Parameters
    ----------
    path : str or Path
    limits : Limits

    Returns
    -------
    Raster

    Raises
    ------
    InputError
        If the file is missing, damaged, too large or of an unknown format.
    """
    path = Path(path)
    try:
        data = read_regular(path, limits, "use an image file")
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InputError(f"{path}: there is no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if not data:
        raise InputError(f"{path}: the file is empty")
    kind, reader = _reader_of(data, path)
    checked = _RecordingLimits(limits.max_pixels, limits.max_bytes, limits.max_ratio)
    try:
        with suppress_native_output():
            raster = reader(data, path, checked)
            values = np.ascontiguousarray(raster.values)
    except InputError:
        raise
    except (MemoryError, ImportError, *_DECODING_ERRORS) as error:
        width, height = max(checked.sizes, key=math.prod, default=(0, 0))
        needed = len(data) + READING_BYTES_PER_PIXEL * width * height
        if is_exhausted(error) or not is_available(needed):
            raise memory_error(
                f"{path}: {width} x {height} pixels", needed, "reduce the image"
            ) from error
        if isinstance(error, ImportError):  # a decoder is not installed properly
            raise
        raise InputError(
            f"{path}: the {kind} file is damaged, incomplete or of an unsupported kind: save it "
            "again as a plain PNG"
        ) from error
    return replace(raster, values=values, sha256=hashlib.sha256(data).hexdigest())


def _reader_of(data: bytes, path: Path) -> tuple[str, _Reader]:
    """The format of a file and its reader."""
    kind, module = _format_of(data, path)
    return kind, cast(_Reader, getattr(import_module(f".{module}", __name__), f"read_{module}"))


def _format_of(data: bytes, path: Path) -> tuple[str, str]:
    """The format of a file and its module."""
    if is_raw(data):
        return "raw", "raw"
    if data[4:8] == b"ftyp":
        (size,) = struct.unpack(">I", data[:4])
        brands = {data[8:12], *(data[k : k + 4] for k in range(16, min(size, 256), 4))}
        if brands & _AVIF_BRANDS:
            return "AVIF", "avif"
        if brands & _HEIF_BRANDS:
            return "HEIC", "heif"
    for magic, kind, module in _FORMATS:
        if data.startswith(magic):
            return kind, module
    raise InputError(
        f"{path}: not an image of a known format (PNG, JPEG, TIFF, HEIC, AVIF, camera raw, EXR, "
        "HDR, BMP, PPM, PGM, NPY): convert it to PNG"
    )


__all__ = ["MIN_SIDE", "Raster", "read_raster"]
