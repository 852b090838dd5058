"""Image files to arrays: one format per file, recognised by the first bytes, not by the name."""

import hashlib
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from ...errors import InputError
from ..limits import USUAL, Limits
from ..native_io import suppress_native_output
from ..regular_files import read_regular
from .bmp import read_bmp
from .exr import read_exr
from .hdr import read_hdr
from .jpeg import read_jpeg
from .npy import read_npy
from .png import read_png, write_png
from .pnm import read_pnm
from .raster import MIN_SIDE, Raster
from .tiff import read_tiff

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
    MemoryError,
    struct.error,
    zlib.error,
    cv2.error,
    Image.DecompressionBombError,
)

_READERS: tuple[tuple[bytes, str, Callable[[bytes, Path, Limits], Raster]], ...] = (
    (b"\x89PNG\r\n\x1a\n", "PNG", read_png),
    (b"\xff\xd8\xff", "JPEG", read_jpeg),
    (b"II*\0", "TIFF", read_tiff),
    (b"MM\0*", "TIFF", read_tiff),
    (b"II+\0", "TIFF", read_tiff),
    (b"MM\0+", "TIFF", read_tiff),
    (b"\x76\x2f\x31\x01", "EXR", read_exr),
    (b"#?RADIANCE", "HDR", read_hdr),
    (b"#?RGBE", "HDR", read_hdr),
    (b"BM", "BMP", read_bmp),
    (b"\x93NUMPY", "NPY", read_npy),
    *((b"P%d" % n, "PPM", read_pnm) for n in range(1, 7)),
)


def read_raster(path: str | Path, limits: Limits = USUAL) -> Raster:
    """Read the values that an image file stores, upright.

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
    kind, reader = next(
        ((kind, reader) for magic, kind, reader in _READERS if data.startswith(magic)), (None, None)
    )
    if reader is None:
        raise InputError(
            f"{path}: not an image of a known format (PNG, JPEG, TIFF, EXR, HDR, BMP, PPM, PGM, "
            "NPY): convert it to PNG"
        )
    try:
        with suppress_native_output():
            raster = reader(data, path, limits)
    except InputError:
        raise
    except _DECODING_ERRORS as error:
        raise InputError(
            f"{path}: the {kind} file is damaged, incomplete or of an unsupported kind: save it "
            "again as a plain PNG"
        ) from error
    values = np.ascontiguousarray(raster.values)
    return replace(raster, values=values, sha256=hashlib.sha256(data).hexdigest())


__all__ = ["MIN_SIDE", "Raster", "read_raster", "write_png"]
