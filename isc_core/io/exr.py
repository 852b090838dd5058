"""Reading and writing of float32 OpenEXR files as arrays, one per channel.

Channels keep their full names (`diffuse.R`, `height.Z`). Compression is lossless (ZIP), and equal
arrays give equal bytes. The library compresses large files on several threads, with identical
bytes.
"""

import errno
import os
import shutil
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from ..errors import InputError
from .exr_header import check_exr, unpacked_bytes
from .limits import DEFAULT_LIMITS, Limits
from .memory import is_exhausted, memory_error
from .native_io import memory_file, suppress_native_output
from .regular_files import read_regular

_LARGE = 1 << 20  # pixels
_MOST_THREADS = 8


def write_channels(path: Path, channels: Mapping[str, np.ndarray]) -> None:
    """Write one scanline file.

    Parameters
    ----------
    path : Path
    channels : mapping of str to (H, W) or (H, W, 3) ndarray
        All of the same height and width. A colour image NAME is written as NAME.R, NAME.G and
        NAME.B, and the image RGB as R, G and B.

    Raises
    ------
    OSError
        If the file cannot be written completely.
    """
    # The writer silently stores garbage from strided arrays: make every channel contiguous.
    pixels = {name: np.ascontiguousarray(values, np.float32) for name, values in channels.items()}
    if max((values.size for values in pixels.values()), default=0) >= _LARGE:
        _start_threads()
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with memory_file() as file_path:
        try:
            with OpenEXR.File(header, pixels) as file:
                file.write(str(file_path))
        except RuntimeError as error:
            raise OSError(errno.EIO, str(error)) from error
        shutil.copyfile(file_path, path)


def _start_threads() -> None:
    """Start the library's threads, if there are none yet; they sleep between files."""
    if hasattr(OpenEXR, "global_thread_count") and not OpenEXR.global_thread_count():
        OpenEXR.set_global_thread_count(min(os.cpu_count() or 1, _MOST_THREADS))


def read_channels(path: Path, limits: Limits = DEFAULT_LIMITS) -> dict[str, np.ndarray]:
    """Read all channels of a file's first part.

    Parameters
    ----------
    path : Path
    limits : Limits

    Returns
    -------
    dict of str to (H, W) float32 ndarray

    Raises
    ------
    InputError
        If it is not a readable OpenEXR file.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist")
    needed = 0
    try:
        data = read_regular(path, None, "use an EXR file")
        needed = unpacked_bytes(check_exr(data, path, limits))
        with (
            suppress_native_output(),
            memory_file(data) as file_path,
            OpenEXR.File(str(file_path), separate_channels=True) as file,
        ):
            return {
                name: np.asarray(channel.pixels, np.float32)
                for name, channel in file.channels().items()
            }
    except InputError:
        raise
    except (
        RuntimeError,
        ValueError,
        TypeError,
        KeyError,
        OSError,
        OverflowError,
        MemoryError,
        struct.error,
    ) as error:
        if is_exhausted(error):
            raise memory_error(f"{path}: its channels", needed, "reduce the image") from error
        raise InputError(f"{path} is not a readable OpenEXR file (damaged or cut short)") from error
