"""Reading and writing of float32 OpenEXR files as arrays, one per channel.

Channels keep their full names (`diffuse.R`, `height.Z`). Compression is lossless (ZIP), and equal
arrays give equal bytes. The library compresses large files on several threads, with identical
bytes.

A file may store a part of its frame: the frame is the display window, the part the data window.
"""

import errno
import os
import shutil
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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


@dataclass(frozen=True, eq=False)
class WindowedChannels:
    """The channels of a file that stores a part of its frame.

    Attributes
    ----------
    channels : dict of str to (h, w) float32 ndarray
        Of the part.
    corner : tuple of int
        (x, y) of the part's upper left pixel in the frame; anywhere, also outside.
    frame : tuple of int
        Rows and columns of the frame.
    """

    channels: dict[str, np.ndarray]
    corner: tuple[int, int]
    frame: tuple[int, int]


def write_channels(
    path: Path,
    channels: Mapping[str, np.ndarray],
    corner: tuple[int, int] = (0, 0),
    frame: tuple[int, int] | None = None,
) -> None:
    """Write one scanline file.

    Parameters
    ----------
    path : Path
    channels : mapping of str to (H, W) or (H, W, 3) ndarray
        All of the same height and width. A colour image NAME is written as NAME.R, NAME.G and
        NAME.B, and the image RGB as R, G and B.
    corner : tuple of int, optional
        (x, y) of their upper left pixel in the frame.
    frame : tuple of int, optional
        Rows and columns of the frame; by default those of the channels.

    Raises
    ------
    OSError
        If the file cannot be written completely.
    """
    # The writer silently stores garbage from strided arrays: make every channel contiguous.
    pixels = {name: np.ascontiguousarray(values, np.float32) for name, values in channels.items()}
    if max((values.size for values in pixels.values()), default=0) >= _LARGE:
        _start_threads()
    header: dict[str, Any] = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
    }
    if frame is not None:
        rows, columns = next(iter(pixels.values())).shape[:2]
        header["dataWindow"] = _window(corner, (rows, columns))
        header["displayWindow"] = _window((0, 0), frame)
    with memory_file() as file_path:
        try:
            with OpenEXR.File(header, pixels) as file:
                file.write(str(file_path))
        except RuntimeError as error:
            raise OSError(errno.EIO, str(error)) from error
        shutil.copyfile(file_path, path)


def _window(corner: tuple[int, int], shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A window of the format: (x, y) of its first and of its last pixel."""
    first = np.array(corner, np.int32)
    return first, first + np.array((shape[1] - 1, shape[0] - 1), np.int32)


def _start_threads() -> None:
    """Start the library's threads, if there are none yet; they sleep between files."""
    if hasattr(OpenEXR, "global_thread_count") and not OpenEXR.global_thread_count():
        OpenEXR.set_global_thread_count(min(os.cpu_count() or 1, _MOST_THREADS))


def read_channels(path: Path, limits: Limits = DEFAULT_LIMITS) -> dict[str, np.ndarray]:
    """Read all channels of a file's first part, in the frame, 0 where the file has no data.

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
    stored = read_windowed(path, limits)
    return {
        name: in_frame(values, stored.corner, stored.frame)
        for name, values in stored.channels.items()
    }


def read_windowed(path: Path, limits: Limits = DEFAULT_LIMITS) -> WindowedChannels:
    """Read all channels of a file's first part, where the file has data.

    Parameters
    ----------
    path : Path
    limits : Limits
        They hold for the whole frame.

    Returns
    -------
    WindowedChannels

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
        limits.check_unpacked(path, needed, len(data))
        with (
            suppress_native_output(),
            memory_file(data) as file_path,
            OpenEXR.File(str(file_path), separate_channels=True) as file,
        ):
            channels = {
                name: np.asarray(channel.pixels, np.float32)
                for name, channel in file.channels().items()
            }
            return WindowedChannels(channels, *place_in_frame(file.header()))
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


def place_in_frame(header: Mapping[str, Any]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return where the data of a file are in its frame, the display window.

    Parameters
    ----------
    header : mapping
        As the library returns it.

    Returns
    -------
    corner : tuple of int
        (x, y) of the upper left pixel of the data.
    frame : tuple of int
        Rows and columns of the frame.
    """
    (first, _), (origin, last) = header["dataWindow"], header["displayWindow"]
    (x, y), (columns, rows) = first - origin, last - origin + 1
    return (int(x), int(y)), (int(rows), int(columns))


def in_frame(values: np.ndarray, corner: tuple[int, int], frame: tuple[int, int]) -> np.ndarray:
    """Return values in a frame that is 0 where it has none.

    Parameters
    ----------
    values : (h, w) ndarray
    corner : tuple of int
        (x, y) of their upper left pixel in the frame; what lies outside is left out.
    frame : tuple of int
        Rows and columns.

    Returns
    -------
    (H, W) float32 ndarray
        The values themselves if they fill the frame.
    """
    if corner == (0, 0) and values.shape == frame and values.dtype == np.float32:
        return values
    (x, y), (rows, columns) = corner, frame
    left, right = max(x, 0), max(min(x + values.shape[1], columns), 0)
    top, bottom = max(y, 0), max(min(y + values.shape[0], rows), 0)
    placed = np.zeros(frame, np.float32)
    if right > left and bottom > top:
        placed[top:bottom, left:right] = values[top - y : bottom - y, left - x : right - x]
    return placed
