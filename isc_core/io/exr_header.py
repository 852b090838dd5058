"""Checks of the header of an OpenEXR file, before the library reads it.

Problem: the library allocates the claimed size of every channel before it checks that the file has
as much data. `OpenEXR.File(header_only=True)` allocates nothing and survived 9,000 damaged headers,
but it returns neither the channels' types, without which the unpacked size is unknown, nor the
number of chunks. Here windows, channels and chunks are checked first, against `Limits` and the size
of the file.

Layout: a magic number, the version with its flags, one header per part (name, type, size, value;
ended by an empty name), then for each part a table of 8 bytes per chunk: a block of lines or a
tile.

Citation: OpenEXR, "OpenEXR File Layout" (Academy Software Foundation, 2023),
https://openexr.com/en/latest/OpenEXRFileLayout.html.

Limits: flat images of full resolution; deep images and subsampled channels are not supported.
"""

import math
import struct
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from .limits import Limits

MAGIC = b"\x76\x2f\x31\x01"
_TILED, _DEEP, _PARTS = 0x200, 0x800, 0x1000
_BYTES = {0: 4, 1: 2, 2: 4}  # per value, by type: unsigned integer, half, float
_LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256)  # scan lines per chunk, by compression
_MAX_CHANNELS, _MAX_PARTS, _MAX_HEADER, _MAX_NAME, _MAX_TILE = 1024, 64, 1 << 20, 255, 1 << 14


@dataclass(frozen=True)
class ExrPart:
    """One part of a file.

    Attributes
    ----------
    data, display : tuple of int
        Windows (left, top, right, bottom), right and bottom inclusive.
    channels : tuple of str
    """

    data: tuple[int, int, int, int]
    display: tuple[int, int, int, int]
    channels: tuple[str, ...]


def size_of(window: tuple[int, int, int, int]) -> tuple[int, int]:
    """Return the width and height of a window.

    Parameters
    ----------
    window : tuple of int
        First and last column and row of pixels: (left, top, right, bottom).

    Returns
    -------
    tuple of int
        Width and height in pixels.
    """
    left, top, right, bottom = window
    return right - left + 1, bottom - top + 1


def unpacked_bytes(parts: tuple[ExrPart, ...]) -> int:
    """Return the memory of a file's channels as float32, in the larger of their windows.

    Parameters
    ----------
    parts : tuple of ExrPart

    Returns
    -------
    int
        In bytes.
    """
    return sum(
        4 * len(part.channels) * max(math.prod(size_of(one)) for one in (part.data, part.display))
        for part in parts
    )


def check_exr(
    data: bytes, path: Path, limits: Limits, stored: int | None = None
) -> tuple[ExrPart, ...]:
    """Check the headers of a file.

    Parameters
    ----------
    data : bytes
        The beginning of the file: all of it, or at least 1 MiB.
    path : Path
        Prefix of the error message.
    limits : Limits
    stored : int, optional
        Size of the file; that of `data` by default.

    Returns
    -------
    tuple of ExrPart

    Raises
    ------
    InputError
        If the file claims more than `limits` allows.
    ValueError, struct.error
        If the file is damaged.
    """
    stored = len(data) if stored is None else stored
    magic, version = struct.unpack_from("<4sI", data)
    if magic != MAGIC or version & 0xFF != 2:
        raise ValueError("not an OpenEXR file of version 2")
    if version & _DEEP:
        raise InputError(f"{path}: a deep image, with many values per pixel: save it as a flat EXR")
    parts, unpacked, at = [], 0, 8
    while True:
        header, at = _attributes(data[:_MAX_HEADER], at)
        if header:
            part, size, chunks = _part(path, header, bool(version & _TILED), limits)
            parts.append(part)
            unpacked += size
            stored -= 8 * chunks
        if not header or not version & _PARTS:
            break
    if not 0 < len(parts) <= _MAX_PARTS or stored < at:
        raise ValueError("no parts, or more chunks than the file has room for")
    limits.check_unpacked(path, unpacked, stored)
    return tuple(parts)


def _attributes(data: bytes, at: int) -> tuple[dict[bytes, bytes], int]:
    """Attributes by name, and the offset of the next header."""
    attributes: dict[bytes, bytes] = {}
    while (end := data.index(b"\0", at, at + _MAX_NAME + 1)) > at:
        kind = data.index(b"\0", end + 1, end + _MAX_NAME + 2)
        (size,) = struct.unpack_from("<i", data, kind + 1)
        start = kind + 5
        if not 0 <= size <= len(data) - start:
            raise ValueError("an attribute is longer than the file")
        attributes[data[at:end]] = data[start : start + size]
        at = start + size
    return attributes, at + 1


def _part(
    path: Path, header: dict[bytes, bytes], tiled: bool, limits: Limits
) -> tuple[ExrPart, int, int]:
    """A part, its unpacked size in bytes, and its number of chunks.

    Raises `ValueError` if an attribute is missing.
    """
    if missing := {b"channels", b"compression", b"dataWindow", b"displayWindow"} - header.keys():
        raise ValueError(f"lacks {sorted(missing)[0]!r}")
    if header.get(b"type", b"").startswith(b"deep"):
        raise InputError(f"{path}: a deep image, with many values per pixel: save it as a flat EXR")
    windows = [_window(header[name]) for name in (b"dataWindow", b"displayWindow")]
    for window in windows:
        limits.check_pixels(path, *size_of(window))
    names, value = _channels(path, header[b"channels"])
    width, height = size_of(windows[0])
    compression = header[b"compression"][0]
    if compression >= len(_LINES):
        raise ValueError("an unknown compression")
    chunks = math.ceil(height / _LINES[compression])
    if tiled or header.get(b"type", b"") == b"tiledimage":
        across, down, _ = struct.unpack("<IIB", header.get(b"tiles", b""))
        if not (0 < across <= _MAX_TILE and 0 < down <= _MAX_TILE):
            raise ValueError("tiles of an impossible size")
        limits.check_unpacked(path, across * down * value, 0)
        chunks = math.ceil(width / across) * math.ceil(height / down)
    return ExrPart(windows[0], windows[1], names), width * height * value, chunks


def _window(value: bytes) -> tuple[int, int, int, int]:
    left, top, right, bottom = struct.unpack("<iiii", value)
    if right < left or bottom < top:
        raise ValueError("a window without pixels")
    return left, top, right, bottom


def _channels(path: Path, value: bytes) -> tuple[tuple[str, ...], int]:
    """Names of the channels, and bytes per pixel of all of them."""
    names, total, at = [], 0, 0
    while (end := value.index(b"\0", at, at + _MAX_NAME + 1)) > at:
        kind, _, across, down = struct.unpack_from("<iB3xii", value, end + 1)
        if (across, down) != (1, 1):
            raise InputError(f"{path}: a subsampled channel: save it as a plain RGB EXR")
        if kind not in _BYTES:
            raise ValueError("a channel of an unknown kind")
        names.append(value[at:end].decode("utf-8"))
        total += _BYTES[kind]
        at = end + 17
    if not 0 < len(names) <= _MAX_CHANNELS or len(set(names)) < len(names):
        raise ValueError("no channels, too many, or repeated ones")
    return tuple(names), total
