"""Decoding of 16-bit PNGs, which Pillow reduces to 8 bits.

Method: PNG filters operate on bytes, separately for each byte position in a pixel. So the high
bytes of all codes, with the filters of their rows, form an 8-bit PNG, and the low bytes another;
Pillow decodes both.

Citation: W3C Recommendation "Portable Network Graphics" (2003), sections 8.2 and 9.
"""

import struct
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from PIL import Image

_MODES = {0: "L", 2: "RGB", 4: "LA", 6: "RGBA"}  # of Pillow, one letter per channel, by colour type
# First column and row, and steps, of the seven passes of an interlaced picture.
_PASSES = (
    *((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4)),
    *((0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)),
)


def deep_codes(header: bytes, packed: bytes) -> np.ndarray:
    """Decode the pixels of a 16-bit PNG.

    Parameters
    ----------
    header : bytes
        Content of the chunk IHDR.
    packed : bytes
        Joined content of the chunks IDAT.

    Returns
    -------
    (H, W) or (H, W, C) uint16 ndarray

    Raises
    ------
    ValueError, OSError
        If the pixels are damaged or incomplete, or of an unknown kind.
    """
    width, height, _, kind, method, filters, interlaced = struct.unpack(">IIBBBBB", header)
    if kind not in _MODES or method or filters or interlaced > 1:
        raise ValueError("a PNG of an unknown kind")
    sizes = list(_sizes(width, height, bool(interlaced)))
    mode = _MODES[kind]
    pixel = 2 * len(mode)
    length = sum(rows * (1 + columns * pixel) for rows, columns in sizes)
    unpacker = zlib.decompressobj()
    lines = np.frombuffer(unpacker.decompress(packed, length), np.uint8)
    if len(lines) != length:
        raise ValueError("pixels are missing")

    def decoded(half: int) -> np.ndarray:
        stored = zlib.compress(_halved(lines, sizes, pixel, half).data, 0)
        size = width, height
        return np.asarray(Image.frombytes(mode, size, stored, "zip", mode, interlaced))

    with ThreadPoolExecutor(1) as aside:
        other = aside.submit(decoded, 1)
        high, low = decoded(0), other.result()
    codes = high.astype(np.uint16)
    codes <<= 8
    codes |= low
    return codes


def _sizes(width: int, height: int, interlaced: bool) -> Iterator[tuple[int, int]]:
    """Rows and columns of the passes that have pixels."""
    for left, top, across, down in _PASSES if interlaced else ((0, 0, 1, 1),):
        rows, columns = -((top - height) // down), -((left - width) // across)
        if rows > 0 and columns > 0:
            yield rows, columns


def _halved(lines: np.ndarray, sizes: list[tuple[int, int]], pixel: int, half: int) -> np.ndarray:
    """The high bytes (half 0) or low bytes (1) of all codes, with the filters of their rows."""
    kept = np.empty(sum(rows * (1 + columns * pixel // 2) for rows, columns in sizes), np.uint8)
    at = start = 0
    for rows, columns in sizes:
        line, short = 1 + columns * pixel, 1 + columns * pixel // 2
        whole = lines[at : at + rows * line].reshape(rows, line)
        part = kept[start : start + rows * short].reshape(rows, short)
        part[:, 0], part[:, 1:] = whole[:, 0], whole[:, 1 + half :: 2]
        at, start = at + rows * line, start + rows * short
    return kept
